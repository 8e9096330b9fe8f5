#pragma once

#include <vector>

namespace smartmill {

/// Cylindrical end mill.
struct ToolGeometry {
  int teeth = 0;              ///< 1..20
  double diameter = 0.0;      ///< [m]
  double helix = 0.0;         ///< [rad] 0 <= helix < 80 deg
  std::vector<double> pitch;  ///< [rad] tooth k to tooth k+1, sums to 2 pi; empty: even

  double radius() const { return 0.5 * diameter; }  ///< [m]
  /// [rad] pitch from tooth k to tooth k+1.
  double pitchOf(int k) const;
  /// [rad] position of tooth k relative to tooth 0: the sum of the pitches before it.
  double toothAngle(int k) const;
  /// [rad/m] lag of the edge with height above the tip: tan(helix) / R.
  double lag() const;
};

/// Radial and axial engagement and feed of a cut. Angles are immersion angles, clockwise from +y; x is the
/// feed direction; up-milling starts at 0, down-milling ends at pi.
struct Engagement {
  double entry = 0.0;           ///< [rad]
  double exit = 0.0;            ///< [rad] > entry
  double axial_depth = 0.0;     ///< [m]
  double feed_per_tooth = 0.0;  ///< [m]
};

/// Linear edge-force model, forces per tooth acting on the tool (Dunwoody eq. 2.1).
struct CuttingCoefficients {
  double ktc = 0.0, krc = 0.0, kac = 0.0;  ///< [N/m2] tangential, radial, axial
  double kte = 0.0, kre = 0.0, kae = 0.0;  ///< [N/m] edge
};

}  // namespace smartmill
