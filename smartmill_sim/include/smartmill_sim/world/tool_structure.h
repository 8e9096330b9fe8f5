#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_sim/world/station_traits.h"

namespace smartmill::sim {

/// A round beam of two sections, from the holder's face (height = length) to the tip (height 0), in one
/// plane: Timoshenko stiffness, consistent mass of cubic shapes with rotary inertia.
struct RoundBeam {
  double length = 0.0;                          ///< [m]
  double fluted = 0.0;                          ///< [m] from the tip
  double shank_diameter = 0.0, diameter = 0.0;  ///< [m] of the shank; of the fluted part
  double young = 0.0, density = 0.0;            ///< [Pa], [kg/m3]
  double poisson = 0.22;                        ///< [1] Poisson's ratio; carbide
  int elements = 24;                            ///< finite elements, far shorter than the bending waves
  bool shear = true;                            ///< false: Euler-Bernoulli beam

  /// Stiffness and mass matrices over (displacement, slope) of the nodes, the holder's face first; slope is d
  /// w / d x with x from the face to the tip. Free at both ends.
  struct Matrices {
    Eigen::MatrixXd stiffness, mass;
    std::vector<double> x;  ///< [m] of the nodes
  };
  Matrices matrices() const;
};

/// A mode of spindle and holder at the holder's face.
struct FaceMode {
  double frequency = 0.0;  ///< [Hz]
  double damping = 0.0;    ///< [1] ratio
  double stiffness = 0.0;  ///< [N/m]
  double slope = 0.0;      ///< [rad/m] rotation of the face over its displacement
};

/// Springs between holder and tool.
struct Joint {
  double across = 0.0;   ///< [N/m]
  double tilting = 0.0;  ///< [N m/rad]
  double loss = 0.0;     ///< [1] loss factor
};

/// Tool and spindle coupled at the holder's face, in one plane: the joint's stiffness connects the beam's
/// first node and the spindle's modal coordinates. The receptances are those of receptance coupling, H = H_tt
/// - H_tf (H_ff + H_s + 1 / k)^-1 H_ft (Schmitz and Donalson; not in Dunwoody). Modes are real: the damping
/// of each component acts on a mode by its share of the energy.
class CoupledTool {
 public:
  /// @param tool_loss [1] loss factor of the beam
  CoupledTool(const RoundBeam& beam, const std::vector<FaceMode>& spindle, const Joint& joint,
              double tool_loss);

  /// Receptance [m/N] between two heights above the tip [m]: modes below `highest` [Hz] plus the static
  /// residual.
  ModalModel between(double read, double struck, double highest) const;
  /// Natural frequencies [Hz], ascending.
  const Eigen::VectorXd& frequencies() const { return frequency_; }

 private:
  Eigen::VectorXd shapeAt(double height) const;

  double length_;
  std::vector<double> x_;
  Eigen::MatrixXd shapes_;  // mass-normalised, a column a mode
  Eigen::MatrixXd stiffness_;
  Eigen::VectorXd frequency_, damping_;
};

/// The tool at the station in x and y: two principal planes.
class ToolStructure {
 public:
  /// @throws Error if the flutes are longer than the stickout.
  ToolStructure(const StationTraits& traits, const ToolGeometry& tool, double stickout);

  /// Receptance [m/N] of displacement along `read_axis` over force along `struck_axis` (0 x, 1 y), heights
  /// above the tip [m].
  ModalModel between(std::size_t read_axis, double read, std::size_t struck_axis, double struck) const;
  /// Drive-point receptances of the tip.
  ToolTip tip() const;

 private:
  std::array<CoupledTool, 2> plane_;
  double turn_, highest_;
};

}  // namespace smartmill::sim
