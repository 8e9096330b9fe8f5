#include "smartmill_core/cutting/chip_rule.h"

#include <algorithm>
#include <string>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

constexpr double SAME_PITCH = 1e-12;  // [rad]

}  // namespace

std::vector<double> runoutRadii(const ToolGeometry& tool, double offset, double angle) {
  std::vector<double> radii;
  for (int j = 0; j < tool.teeth; ++j) radii.push_back(offset * std::cos(angle - tool.toothAngle(j)));
  return radii;
}

ChipRule::ChipRule(const ToolGeometry& tool, std::vector<double> radius_offset)
    : offset_(std::move(radius_offset)), curvature_(tool.diameter > 0.0 ? 1.0 / tool.diameter : 0.0) {
  const auto teeth = static_cast<std::size_t>(tool.teeth);
  if (offset_.empty()) offset_.assign(teeth, 0.0);
  if (offset_.size() != teeth) {
    throw Error("cutting: " + std::to_string(offset_.size()) + " radius offsets for " +
                std::to_string(teeth) + " teeth");
  }
  for (int j = 0; j < tool.teeth; ++j) {
    tooth_angle_.push_back(tool.toothAngle(j));
    pitch_.push_back(tool.pitchOf(j));
    alike_ = alike_ && offset_[static_cast<std::size_t>(j)] == offset_[0] &&
             std::abs(pitch_.back() - pitch_[0]) < SAME_PITCH;
  }
  const double largest = *std::max_element(offset_.begin(), offset_.end());
  for (int j = 0; j < tool.teeth; ++j)
    overhang_.push_back(largest - offset_[static_cast<std::size_t>(ahead(j, 1))]);
}

double ChipRule::turn(int j, int n) const {
  const int turns = n / teeth(), rest = n % teeth();
  double angle = turns * units::TWO_PI;
  for (int k = 0; k < rest; ++k) angle += pitch_[static_cast<std::size_t>(ahead(j, k))];
  return angle;
}

double ChipRule::step(int j, int n) const {
  return offset_[static_cast<std::size_t>(j)] - offset_[static_cast<std::size_t>(ahead(j, n))];
}

ChipShape ChipRule::shape(int j, int n, const std::array<double, 2>& fed,
                          const std::array<double, 2>& fed_first, const std::array<double, 2>& moved) const {
  // (D x e)^2 = |D|^2 / 2 + (Dx^2 - Dy^2) / 2 cos(2 phi) - Dx Dy sin(2 phi).
  const auto square = [](const std::array<double, 2>& d) {
    return std::array<double, 2>{{d[0] * d[0], d[1] * d[1]}};
  };
  const std::array<double, 2> now = square(fed), first = square(fed_first);
  const double x2 = now[0] - first[0], y2 = now[1] - first[1];
  const double xy = fed[0] * fed[1] - fed_first[0] * fed_first[1];
  return {step(j, n) + 0.5 * curvature_ * (x2 + y2), fed[0] + moved[0], fed[1] + moved[1], -curvature_ * xy,
          0.5 * curvature_ * (x2 - y2)};
}

ChipShape ChipRule::steadyShape(int j, int n, const std::array<double, 2>& feed, double path_share) const {
  const double turned = turn(j, n), first = turn(j, 1);
  ChipShape steady =
      shape(j, n, {{feed[0] * turned, feed[1] * turned}}, {{feed[0] * first, feed[1] * first}});
  if (path_share == 0.0) return steady;
  // With f: (f x e)^2 as in shape(), 2 (f x e) f.e = (fx^2 - fy^2) sin(2 phi) + 2 fx fy cos(2 phi).
  const double share = path_share * curvature_, round = share * first * first;
  const double x2 = feed[0] * feed[0], y2 = feed[1] * feed[1], xy = feed[0] * feed[1];
  steady.level += 0.5 * round * (x2 + y2);
  steady.sine2 -= round * xy + share * turned * (x2 - y2);
  steady.cosine2 += 0.5 * round * (x2 - y2) - 2.0 * share * turned * xy;
  return steady;
}

}  // namespace smartmill
