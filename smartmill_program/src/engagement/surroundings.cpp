#include "surroundings.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

using units::PI;
using units::UM;

constexpr int SAMPLES = 180;            // intervals of a degree; an arc narrower than one may be missed
constexpr int BISECTIONS = 7;           // to 0.008 deg
constexpr double LEAST_DEPTH = 1 * UM;  // last digit of a program
/// [m] An arc that is narrower across the feed is rounding: two passes along one wall differ by twice the
/// last digit.
constexpr double LEAST_WIDTH = 2 * UM;
/// Depths within one arc differ by less than the larger of these.
constexpr double SAME_DEPTH = 20 * UM;
constexpr double SAME_DEPTH_SHARE = 0.05;

bool alike(double a, double b) {
  return std::abs(a - b) <= std::max(SAME_DEPTH, SAME_DEPTH_SHARE * std::max(a, b));
}

}  // namespace

Surroundings::Surroundings(const Stock& stock, const ToolPlace& place)
    : stock_(stock),
      tip_(place.tip),
      share_(std::hypot(place.direction[0], place.direction[1])),
      rise_(place.direction[2]) {
  if (share_ > LEVEL) x_ = {place.direction[0] / share_, place.direction[1] / share_};
  const double side = place.left_hand ? -1.0 : 1.0;
  y_ = {-side * x_[1], side * x_[0]};
}

double Surroundings::above(double phi, double distance, double height) const {
  const double s = distance * std::sin(phi), c = distance * std::cos(phi);
  return stock_.height(tip_[0] + s * x_[0] + c * y_[0], tip_[1] + s * x_[1] + c * y_[1]) -
         std::max(tip_[2] + height, stock_.block().low[2]);
}

std::vector<EngagedArc> cylinderArcs(const Surroundings& around, double radius, double bottom) {
  std::vector<EngagedArc> arcs;
  if (around.tip() + bottom >= around.stock().block().high[2]) return arcs;
  const auto depthAt = [&](double phi) {
    const double above = around.above(phi, radius, bottom);
    return above > LEAST_DEPTH ? above : 0.0;
  };
  const auto change = [&](double low, double high, double depth_low, double depth_high) {
    for (int i = 0; i < BISECTIONS; ++i) {
      const double middle = 0.5 * (low + high), d = depthAt(middle);
      (std::abs(d - depth_low) < std::abs(d - depth_high) ? low : high) = middle;
    }
    return 0.5 * (low + high);
  };
  // In the middle of each degree: at 0 and pi exactly, the tool touches the wall that it leaves.
  const auto angle = [](int k) { return PI * (k + 0.5) / SAMPLES; };
  EngagedArc arc{0.0, 0.0, bottom, bottom, radius};
  double first = depthAt(angle(0)), before = first,
         sum = first;  // of the arc: first depth and sum, and the last depth
  int count = 1;
  const auto close = [&](double exit) {
    arc.exit = exit;
    arc.top = bottom + sum / count;
    if (first > 0.0 && arc.width() > LEAST_WIDTH) arcs.push_back(arc);
    arc.entry = exit;
  };
  for (int k = 1; k < SAMPLES; ++k) {
    const double depth = depthAt(angle(k));
    const bool jumps = !alike(depth, before) || (depth > 0.0) != (before > 0.0);
    if (jumps || !alike(depth, first)) {
      close(jumps ? change(angle(k - 1), angle(k), before, depth) : 0.5 * (angle(k - 1) + angle(k)));
      first = depth;
      sum = 0.0;
      count = 0;
    }
    before = depth;
    sum += depth;
    ++count;
  }
  close(PI);
  return arcs;
}

}  // namespace smartmill::program
