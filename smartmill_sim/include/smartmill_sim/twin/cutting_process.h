#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/cutting/tool.h"

namespace smartmill::sim {

/// A stretch of immersion angles at which the teeth meet material, over a height of the tool.
struct ContactArc {
  double entry = 0.0;  ///< [rad] 0..2 pi, clockwise from +y of the machine
  double exit = 0.0;   ///< [rad] > entry, <= 2 pi
  double depth = 0.0;  ///< [m] from the tip up
};

/// @throws Error on an arc outside 0..2 pi or without height.
void validate(const ContactArc& arc);

/// Makes empty radius offsets zeros. @throws Error when there is not one a tooth.
void checkOffsets(const ToolGeometry& tool, std::vector<double>& radius_offset);

/// Where the tool is and how it moves.
struct ToolMotion {
  double angle = 0.0;                          ///< [rad] immersion angle of tooth 1 at its tip
  double speed = 0.0;                          ///< [rad/s] of the spindle, >= 0
  std::array<double, 2> centre{{0, 0}};        ///< [m] x, y of the undeflected tool
  std::array<double, 2> velocity{{0, 0}};      ///< [m/s] of the undeflected tool
  std::array<double, 2> displacement{{0, 0}};  ///< [m] vibration of the tip
};

/// How a chip turns into force.
struct CuttingLaw {
  CuttingCoefficients coefficients;  ///< edge terms hold while there is a chip
  double chip_factor = 1.0;          ///< [1] on ktc, krc, kac
  double edge_factor = 1.0;          ///< [1] on kte, kre, kae
  double edge_chip = 0.0;            ///< [m] kte, kre, kae times 1 - exp(-chip / edge_chip); 0: there at once
  double size_exponent = 0.0;        ///< [1] ktc, krc, kac times (chip / size_reference)^-size_exponent
  double size_reference = 1e-4;      ///< [m]
  double damping = 0.0;  ///< [N/m] per engaged edge: radial force damping * v_r / v_c, tangential 0.3 of it
};

/// [1] on the edge coefficients at a chip [m]; the factor of the law included.
inline double edgeShare(const CuttingLaw& law, double chip) {
  return law.edge_chip > 0.0 ? law.edge_factor * -std::expm1(-chip / law.edge_chip) : law.edge_factor;
}

/// Milling with regeneration: each tooth meets the surface that all teeth before it left, so that vibration,
/// runout, uneven pitch and loss of contact come out of the geometry (Dunwoody 2.2 and 6.1 with the exact
/// kinematics instead of the linear delay). The tool is cut into slices along its axis; each keeps the radial
/// reach of the surface over the immersion angle. A slice that is partly past entry or exit counts by its
/// part in cut.
class CuttingProcess {
 public:
  /// [rad] The mid-slice rule errs by 2e-5 of the force; a sensor mode of little damping that the ends of the
  /// slices meet shows more.
  static constexpr double SLICE_ANGLE = 0.02;

  /// @param radius_offset [m] of each tooth (runout), empty: none. @throws Error on an impossible tool.
  /// @param slice_angle lag over a slice of the edge [rad]
  CuttingProcess(const ToolGeometry& tool, const CuttingLaw& law, std::vector<double> radius_offset = {},
                 double slice_angle = SLICE_ANGLE);

  /// Changes where there is material. Angles that were in air get the surface that steady cutting with the
  /// present motion leaves. @throws Error on an arc outside 0..2 pi or without height.
  void engage(const std::vector<ContactArc>& arcs, const ToolMotion& now);
  const std::vector<ContactArc>& arcs() const { return arcs_; }
  /// Depth of each arc [m] > 0, without touching the surface below the least depth so far.
  void setDepths(const std::vector<double>& depths, const ToolMotion& now);

  CuttingLaw& law() { return law_; }

  /// Force on the tool at this motion; the surface is cut from the last motion to this one. Steps shorter
  /// than half a revolution.
  CuttingForce step(const ToolMotion& now);

 private:
  struct Slice {
    double low, high;             // [m] above the tip
    std::vector<double> surface;  // [m] reach from the machine's origin at each node's angle
    std::vector<double> chip;     // [m] last chip of each tooth
  };
  /// Where the tip was when the spindle stood at an angle.
  struct Passage {
    double turned = 0.0;                // [rad] since the first step
    std::array<double, 2> tip{{0, 0}};  // [m] centre and vibration
  };
  void remember(const ToolMotion& now, double turned);
  /// [m] the tip when the spindle stood so far back [rad], at most a few nodes of the surface.
  std::array<double, 2> tipBack(double angle) const;
  double steadySurface(double node_angle, double lag, const ToolMotion& now) const;
  /// [rad] of the middle of the slice's part in the arc.
  double lagOf(const Slice& slice, const ContactArc& arc) const;
  void growTo(double depth);
  /// The first of the two nodes whose surface gives the chip between node `left` and the next.
  long leftNode(long left, const ToolMotion& now) const;
  void cut(Slice& slice, int tooth, double before, double angle, const ContactArc& arc, const ToolMotion& now,
           CuttingForce& sum);

  ToolGeometry tool_;
  CuttingLaw law_;
  std::vector<double> offset_;
  std::vector<ContactArc> arcs_;
  std::vector<Slice> slices_;
  std::vector<double> sin_, cos_;  // of the nodes
  double height_;                  // [m] of a slice
  ToolMotion last_;
  bool moved_ = false;
  double turned_ = 0.0;            // [rad] since the first step
  std::vector<Passage> passages_;  // ring, some to each node of the surface
  std::size_t newest_ = 0;
};

}  // namespace smartmill::sim
