#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "smartmill_core/cutting/tool.h"

namespace smartmill {

/// [m] Radius of each tooth over the nominal one when the cutter's axis lies beside the spindle's: offset
/// cos(angle - position of the tooth), so that the offset points to a tooth at that angle (effects.md,
/// runout).
std::vector<double> runoutRadii(const ToolGeometry& tool, double offset, double angle);

/// Chip thickness [m] of a tooth against one surface, over the immersion angle phi of a piece of its edge:
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
  /// [m/rad2] The second derivative is nowhere larger.
  double bend() const {
    return std::abs(sine) + std::abs(cosine) + 4.0 * (std::abs(sine2) + std::abs(cosine2));
  }
  ChipShape operator-(const ChipShape& o) const {
    return {level - o.level, sine - o.sine, cosine - o.cosine, sine2 - o.sine2, cosine2 - o.cosine2};
  }
};

/// The rule of the surface that a tooth meets (formats.md): its chip is the least of its distances h_n to
/// what the passes n = 1, 2, ... before it left at the same immersion angle phi,
///
///     h_n = D_n.e + ((D_n x e)^2 - (D_1 x e)^2) / (2 R) + r_j - r_j(n) + (u - u_n).e
///
/// e = (sin phi, cos phi) the direction from the tool's centre, D_n the feed since that pass, r the teeth's
/// own radii, u the displacement now, u_n the one when that tooth stood at phi; the same for all heights of
/// the edge. With a feed F_n along x: F_n sin(phi) + (F_n^2 - F_1^2) cos^2(phi) / (2 R). Tooth j meets what
/// tooth j + 1 left first (it stands pitch[j] ahead), and after a whole turn what it left itself. Every pass
/// exists from the beginning: before the material, or the record, the tool went on as now and did not
/// vibrate.
class ChipRule {
 public:
  /// @param radius_offset [m] r of each tooth, empty: all alike. @param diameter in tool: 0 leaves the
  /// roundness out.
  /// @throws Error when there is not one offset a tooth.
  explicit ChipRule(const ToolGeometry& tool, std::vector<double> radius_offset = {});

  int teeth() const { return static_cast<int>(offset_.size()); }
  /// [rad] of each tooth against the first.
  const std::vector<double>& toothAngle() const { return tooth_angle_; }
  /// Whether every tooth meets the same chips.
  bool alike() const { return alike_; }
  /// [m] By how much the largest radius stands over that of the tooth whose surface tooth j meets first.
  double overhang(int j) const { return overhang_[static_cast<std::size_t>(j)]; }

  /// The tooth that passed n places ahead of tooth j, n >= 1.
  int ahead(int j, int n) const { return (j + n) % teeth(); }
  /// [rad] How far the spindle has turned since then.
  double turn(int j, int n) const;
  /// [m] r_j less the radius of that tooth.
  double step(int j, int n) const;

  /// The chip of tooth j against its pass n. @param fed, fed_first [m] D_n, D_1. @param moved [m] u - u_n
  ChipShape shape(int j, int n, const std::array<double, 2>& fed, const std::array<double, 2>& fed_first,
                  const std::array<double, 2>& moved = {{0.0, 0.0}}) const;
  /// The same of a tool that does not vibrate. @param feed [m/rad] of the spindle @param path_share [1] of
  /// the way from the rule (0) to the true path of the teeth (1): a tooth left what lies on the ray when it
  /// stood at psi = phi + (D_n x e) / R, and not at phi, and the first pass is as round as the others,
  ///
  ///     h_n + ((D_1 x e)^2 / 2 - (D_n x e) f.e) / R,  f the feed a radian
  ChipShape steadyShape(int j, int n, const std::array<double, 2>& feed, double path_share = 0.0) const;

 private:
  std::vector<double> offset_, overhang_, tooth_angle_, pitch_;
  double curvature_;  // [1/m] 1 / (2 R)
  bool alike_ = true;
};

}  // namespace smartmill
