#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "smartmill_core/cutting/tool.h"

namespace smartmill {

/// [m] Radius of each tooth above the nominal one when the cutter's axis is offset from the spindle's: offset
/// cos(angle - position of the tooth). The offset points to a tooth at that angle (effects.md, runout).
std::vector<double> runoutRadii(const ToolGeometry& tool, double offset, double angle);

/// Chip thickness [m] of a tooth against one surface, over the immersion angle phi of a segment of its edge:
/// level + sine sin(phi) + cosine cos(phi) + sine2 sin(2 phi) + cosine2 cos(2 phi).
struct ChipShape {
  double level = 0.0, sine = 0.0, cosine = 0.0, sine2 = 0.0, cosine2 = 0.0;

  double at(double s, double c) const {
    return level + s * (sine + 2.0 * sine2 * c) + c * cosine + cosine2 * (1.0 - 2.0 * s * s);
  }
  /// [m/rad]
  double slope(double s, double c) const {
    return sine * c - cosine * s + 2.0 * (sine2 * (1.0 - 2.0 * s * s) - 2.0 * cosine2 * s * c);
  }
  /// [m/rad2] Upper bound of the second derivative.
  double bend() const {
    return std::abs(sine) + std::abs(cosine) + 4.0 * (std::abs(sine2) + std::abs(cosine2));
  }
  ChipShape operator-(const ChipShape& o) const {
    return {level - o.level, sine - o.sine, cosine - o.cosine, sine2 - o.sine2, cosine2 - o.cosine2};
  }
};

/// The surface that a tooth meets (formats.md): its chip is the smallest of its distances h_n to the surfaces
/// left by the previous passes n = 1, 2, ... at the same immersion angle phi,
///
///     h_n = D_n.e + ((D_n x e)^2 - (D_1 x e)^2) / (2 R) + r_j - r_j(n) + (u - u_n).e
///
/// e = (sin phi, cos phi) the direction from the tool's centre, D_n the feed since that pass, r the teeth's
/// own radii, u the present displacement, u_n the displacement when that tooth was at phi; the same for all
/// heights of the edge. With a feed F_n along x: F_n sin(phi) + (F_n^2 - F_1^2) cos^2(phi) / (2 R). Tooth j
/// first meets the surface left by tooth j + 1, which is pitch[j] ahead, and after a whole revolution its
/// own. Every pass exists from the beginning: before the engagement, or the record, the tool is assumed to
/// have moved as now without vibration.
class ChipRule {
 public:
  /// @param radius_offset [m] r of each tooth, empty: all equal. @param tool with diameter 0: the roundness
  /// of the tool is neglected.
  /// @throws Error when the number of offsets is not the number of teeth.
  explicit ChipRule(const ToolGeometry& tool, std::vector<double> radius_offset = {});

  int teeth() const { return static_cast<int>(offset_.size()); }
  /// [rad] of each tooth relative to the first.
  const std::vector<double>& toothAngle() const { return tooth_angle_; }
  /// Whether all teeth have the same chip.
  bool alike() const { return alike_; }
  /// [m] Largest radius minus that of the tooth whose surface tooth j meets first.
  double overhang(int j) const { return overhang_[static_cast<std::size_t>(j)]; }

  /// The tooth n passes ahead of tooth j, n >= 1.
  int ahead(int j, int n) const { return (j + n) % teeth(); }
  /// [rad] Spindle rotation since that pass.
  double turn(int j, int n) const;
  /// [m] r_j minus the radius of that tooth.
  double step(int j, int n) const;

  /// The chip of tooth j relative to pass n. @param fed, fed_first [m] D_n, D_1. @param moved [m] u - u_n
  ChipShape shape(int j, int n, const std::array<double, 2>& fed, const std::array<double, 2>& fed_first,
                  const std::array<double, 2>& moved = {{0.0, 0.0}}) const;
  /// The same for a tool that does not vibrate. @param feed [m/rad] of the spindle @param path_share [1]
  /// interpolates from the rule (0) to the true path of the teeth (1): there a tooth leaves the point on the
  /// ray when it is at psi = phi + (D_n x e) / R instead of phi, and the first pass is as round as the
  /// others,
  ///
  ///     h_n + ((D_1 x e)^2 / 2 - (D_n x e) f.e) / R,  f the feed a radian
  ChipShape steadyShape(int j, int n, const std::array<double, 2>& feed, double path_share = 0.0) const;

 private:
  std::vector<double> offset_, overhang_, tooth_angle_, pitch_;
  double curvature_;  // [1/m] 1 / (2 R)
  bool alike_ = true;
};

}  // namespace smartmill
