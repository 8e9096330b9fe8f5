#include "smartmill_discrepancy/data/chatter.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/signal/chatter_criterion.h"
#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

constexpr double LEAST_FREQUENCY = 80.0;  // [Hz] drift, hum and slow trends are below
/// Revolutions of a window: enough to separate chatter from the harmonics, few enough that an error of the
/// stated speed of 0.1 % does not.
constexpr std::size_t LEAST_TURNS = 3, MOST_TURNS = 8;

/// Evidence of each window of a channel from a sample on.
std::vector<ChatterEvidence> judge(const std::vector<double>& series, std::size_t from, double revolution,
                                   double period) {
  ChatterCriterionOptions options;
  options.energy_ratio = CHATTER_SHARE * CHATTER_SHARE;
  options.lowest_frequency = LEAST_FREQUENCY;
  options.alternation_ratio = 1.0;  // a flip repeats every revolution, and so does the simulation
  const ChatterCriterion criterion(options);
  const double start = static_cast<double>(std::max<std::size_t>(from, 1));
  const double revolutions = (static_cast<double>(series.size()) - 3.0 - start) / revolution;
  std::vector<ChatterEvidence> found;
  if (!(revolutions >= LEAST_TURNS)) return found;
  const std::size_t turns = std::min(MOST_TURNS, static_cast<std::size_t>(revolutions));
  for (double at = 0.0; at + static_cast<double>(turns) <= revolutions; at += static_cast<double>(turns)) {
    RevolutionWindow window(static_cast<std::size_t>(std::ceil(revolution)), turns, 0);
    window.add(series, start + at * revolution, revolution);
    found.push_back(criterion.judge(window, period));
  }
  return found;
}

}  // namespace

std::optional<Chatter> findChatter(const Record& record, const CampaignTest& test, std::size_t first_cut) {
  if (test.kind != TestKind::cut || !(test.spindle_speed > 0.0)) return {};
  const double period = units::TWO_PI / test.spindle_speed;
  const std::size_t from = first_cut + (record.size() - std::min(first_cut, record.size())) / 2;
  Chatter chatter;
  chatter.share = 1.0;
  for (const char* channel : {"fx", "fy"}) {
    if (!record.has(channel)) return {};
    const std::vector<ChatterEvidence> windows =
        judge(record.column(channel), from, period * test.sample_rate, period);
    const auto chattering = std::count_if(windows.begin(), windows.end(),
                                          [](const ChatterEvidence& window) { return window.chatter; });
    if (windows.empty() || 2 * chattering < static_cast<std::ptrdiff_t>(windows.size())) return {};
    for (const ChatterEvidence& window : windows) {
      if (!window.chatter) continue;
      chatter.share = std::min(chatter.share, std::sqrt(window.energy_ratio));
      const double amplitude = std::sqrt(2.0 * window.line_power);
      if (amplitude < chatter.amplitude) continue;
      chatter.amplitude = amplitude;
      chatter.frequency = window.order / period;
    }
  }
  return chatter;
}

}  // namespace smartmill::discrepancy
