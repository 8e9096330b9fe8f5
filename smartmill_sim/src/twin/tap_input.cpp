#include "twin/tap_input.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "smartmill_core/model/effect.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/signal/window.h"

namespace smartmill::sim {
namespace {

const std::array<const char*, 2> TIP{{"tool_x", "tool_y"}};

}  // namespace

std::vector<double> contactForce(const std::vector<double>& hammer) {
  constexpr double SECOND_HIT = 0.05;
  if (hasSecondHit(hammer, SECOND_HIT)) return hammer;
  std::vector<double> force = impactWindow(hammer);
  for (std::size_t i = 0; i < force.size(); ++i) force[i] *= hammer[i];
  return force;
}

TapTarget targetOf(const Record& record, std::size_t axis) {
  const std::vector<double>& hammer = record.column("hammer");
  const auto louder = [](double a, double b) { return std::abs(a) < std::abs(b); };
  const auto hit =
      static_cast<std::size_t>(std::max_element(hammer.begin(), hammer.end(), louder) - hammer.begin());
  const auto responds = [&](const char* channel) {
    constexpr std::size_t LEAST_QUIET = 20;
    if (!record.has(channel) || hit < 2 * LEAST_QUIET) return false;
    const std::vector<double>& x = record.column(channel);
    const auto quiet_end = x.begin() + static_cast<std::ptrdiff_t>(hit - LEAST_QUIET);
    const double deviation = standardDeviation({x.begin(), quiet_end}), level = mean({x.begin(), quiet_end});
    const auto peak = std::max_element(quiet_end, x.end(),
                                       [&](double a, double b) { return louder(a - level, b - level); });
    return std::abs(*peak - level) > 10.0 * deviation;
  };
  TapTarget target{false, responds(channelName(FX + axis))};
  if (axis < 2)
    target.tip = responds(channelName(TOOL_X + axis)) || responds("displacement") || responds("acceleration");
  if (!target.tip && !target.sensor) {
    // No response: the target follows from the measured channels.
    target.tip =
        axis < 2 && (record.has(TIP[axis]) || record.has("displacement") || record.has("acceleration"));
    target.sensor = !target.tip;
  }
  return target;
}

}  // namespace smartmill::sim
