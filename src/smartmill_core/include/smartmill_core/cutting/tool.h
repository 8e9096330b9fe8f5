#pragma once

#include <string>
#include <vector>

#include "smartmill_core/units.h"

namespace smartmill {

/// Shape of the cutting edges of a mill. The default is that of a flat end mill: vertical, smooth edges of
/// one helix angle (general end mill of Engin & Altintas 2001).
struct EdgeShape {
  double corner_radius = 0.0;  ///< [m] that of the tool: ball end
  /// [rad] 0 < value <= pi/2: of the edge above the corner to the plane across the tool axis (kappa_r of ISO
  /// 3002, KAPR of ISO 13399); pi/2: cylindrical mill.
  double edge_angle = 0.5 * units::PI;
  std::vector<double> helix = {};  ///< [rad] of each tooth; empty: that of the tool
  /// [m] Serrated edge: radius of tooth k at height z + amplitude sin(2 pi (z / wavelength + k / teeth)).
  double serration_amplitude = 0.0;
  double serration_wavelength = 0.0;  ///< [m] > 0 with an amplitude

  /// Whether the normal of the edge leaves the plane across the tool axis.
  bool inclined() const { return corner_radius > 0.0 || edge_angle < 0.5 * units::PI; }
  bool serrated() const { return serration_amplitude > 0.0; }
  /// Whether the edge is that of a flat end mill with one helix angle.
  bool straight() const { return !inclined() && !serrated() && helix.empty(); }
};

/// Mill: teeth about an axis and the shape of their edges.
struct ToolGeometry {
  int teeth = 0;          ///< 1..20
  double diameter = 0.0;  ///< [m] above the corner; with an edge angle where the extended edge meets the tip
  double helix = 0.0;     ///< [rad] 0 <= helix < 80 deg; with one for each tooth: of the mean lag
  std::vector<double> pitch;  ///< [rad] tooth k to tooth k+1 at the tip, sums to 2 pi; empty: even
  EdgeShape edge = {};

  double radius() const { return 0.5 * diameter; }  ///< [m]
  /// [rad] pitch from tooth k to tooth k+1.
  double pitchOf(int k) const;
  /// [rad] position of tooth k relative to tooth 0: the sum of the pitches before it.
  double toothAngle(int k) const;
  /// [rad/m] lag of the edge with height above the tip: tan(helix) / R.
  double lag() const;
  /// [rad/m] that of tooth k.
  double lagOf(int k) const;
  /// [rad] pitch from tooth k to tooth k+1 at a height [m]. @throws Error where the edges meet.
  double pitchAt(int k, double height) const;
  /// Variable helix [rad], one value for each tooth.
  void setHelix(const std::vector<double>& of_each_tooth);
};

/// @throws Error naming the first key of the model file that shapes the edge otherwise. @param why "to ..."
void requireStraightEdge(const ToolGeometry& tool, const std::string& why);

/// Engagement of a range of the tool's height.
struct EngagementBand {
  double entry = 0.0;   ///< [rad]
  double exit = 0.0;    ///< [rad] > entry
  double bottom = 0.0;  ///< [m] above the tip
  double top = 0.0;     ///< [m] > bottom
};

/// Radial and axial engagement and feed of a cut. Angles are immersion angles, clockwise from +y; x is the
/// feed direction; up-milling starts at 0, down-milling ends at pi.
struct Engagement {
  double entry = 0.0;           ///< [rad]; of several bands the least
  double exit = 0.0;            ///< [rad] > entry; of several bands the largest
  double axial_depth = 0.0;     ///< [m] from the tip to the highest contact
  double feed_per_tooth = 0.0;  ///< [m]
  /// Where the engagement changes over the height (ball end, steps in the stock), from the tip up; empty:
  /// entry to exit over the whole depth.
  std::vector<EngagementBand> bands{};
  /// [m] of the axial feed into the work (a ramp down); up: negative. Curved and inclined edges cut it too.
  double axial_feed_per_tooth = 0.0;
};

/// Linear edge-force model, forces per tooth acting on the tool (Dunwoody eq. 2.1).
struct CuttingCoefficients {
  double ktc = 0.0, krc = 0.0, kac = 0.0;  ///< [N/m2] tangential, radial, axial
  double kte = 0.0, kre = 0.0, kae = 0.0;  ///< [N/m] edge
};

}  // namespace smartmill
