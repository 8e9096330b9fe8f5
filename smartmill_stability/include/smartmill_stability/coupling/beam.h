#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace smartmill::stability {

/// Receptances between two points of a structure that vibrates in one plane: displacement [m] and rotation
/// [rad] (rows) for a force [N] and a moment [N m] (columns),
///
///     [ H  L ]     H [m/N]     L [m/(N m)]
///     [ N  P ]     N [rad/N]   P [rad/(N m)]
///
/// Rotation is dw/dx of the axis, x from the tip to the spindle.
using Receptance = Eigen::Matrix2cd;

/// Isotropic material with structural damping E (1 + i loss).
struct BeamMaterial {
  double young = 0.0;    ///< [N/m2] > 0
  double density = 0.0;  ///< [kg/m3] > 0
  double poisson = 0.3;  ///< [1] 0 <= value < 0.5
  double loss = 0.0;     ///< [1] loss factor, twice the damping ratio of a mode, >= 0
};

/// steel, carbide (10 % cobalt) or hss. @throws Error naming the known ones.
BeamMaterial beamMaterial(const std::string& name);

/// A uniform round part of a tool, holder or gauge.
struct BeamSegment {
  double length = 0.0;    ///< [m] > 0
  double diameter = 0.0;  ///< [m] > 0
  double bore = 0.0;      ///< [m] 0 <= bore < diameter
  BeamMaterial material;
  /// Material that fills the bore: the shank of a tool in its holder. Density 0: the bore is empty.
  BeamMaterial core;

  /// @throws Error naming the quantity and its value.
  void validate() const;
};

/// Receptances of a free-free structure between its ends: 1 towards the tip, 2 towards the spindle.
struct EndReceptances {
  Receptance r11, r12, r21, r22;
};

/// Free-free Timoshenko beam by the four waves of its equation of motion: exact at every frequency. Shear
/// coefficient of a round or hollow section by Cowper (J. Appl. Mech. 33, 1966). @param f [Hz] > 0
EndReceptances beamReceptances(const BeamSegment& segment, double f);

/// Segments from the tip to the spindle, rigidly joined. @throws Error without segments.
EndReceptances beamReceptances(const std::vector<BeamSegment>& segments, double f);

/// Two structures joined through a compliance [as Receptance] between end 2 of the first and end 1 of the
/// second (receptance coupling, Schmitz and Duncan, J. Manuf. Sci. Eng. 127, 2005); zero: rigidly.
EndReceptances joined(const EndReceptances& tip, const EndReceptances& back, const Receptance& compliance);

/// End 1 of a structure whose end 2 is joined to another with a known receptance at the joint.
Receptance joined(const EndReceptances& tip, const Receptance& back, const Receptance& compliance);

}  // namespace smartmill::stability
