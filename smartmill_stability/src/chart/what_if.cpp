#include "smartmill_stability/chart/what_if.h"

#include <algorithm>
#include <cmath>

#include "chart/spindle_load.h"
#include "smartmill_core/error.h"
#include "smartmill_core/require.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/chart/limit_continuation.h"
#include "smartmill_stability/chart/risk.h"

namespace smartmill::stability {
namespace {

struct WhatIfOptions {
  int draws = 40;                ///< machines for the quantiles; four lie below the lower one
  unsigned seed = 1;             ///< the spread depends on the request only
  double low = 0.1, high = 0.9;  ///< [1] quantiles of the spread
  int speeds = 300;              ///< of a chart: one for each four pixels of the page
  /// [m] Depths above three times the requested one, and above this, take time and are not shown.
  double least_depth = 0.01;
};
constexpr WhatIfOptions WHAT_IF;

// The spread is computed by the zero-order solution and applied as a ratio to the limits of the chart.
void addSpread(const UncertainSystem& system, WhatIfChart& chart) {
  const std::vector<double>& speeds = chart.limit.spindle_speed;
  const DrawnLimits limits = drawnLimits(system, speeds, WHAT_IF.draws, WHAT_IF.seed);
  std::vector<std::vector<double>> ratios(speeds.size());
  for (const std::vector<double>& drawn : limits.drawn)
    for (std::size_t k = 0; k < speeds.size(); ++k) ratios[k].push_back(drawn[k] / limits.mean[k]);
  for (std::size_t k = 0; k < speeds.size(); ++k) {
    std::sort(ratios[k].begin(), ratios[k].end());
    const auto at = [&](double share) {
      return ratios[k][static_cast<std::size_t>(share * (WHAT_IF.draws - 1))];
    };
    chart.limit_low.push_back(chart.limit.depth[k] * at(WHAT_IF.low));
    chart.limit_high.push_back(chart.limit.depth[k] * at(WHAT_IF.high));
  }
}

}  // namespace

void WhatIf::validate() const {
  const auto optional = [](const char* key, double value, const Range& range, const char* unit) {
    if (!std::isnan(value)) require(key, value, range, unit);
  };
  require("teeth", teeth, Range::closed(0, 20));
  optional("helix", helix, Range::openHigh(0.0, units::radFromDeg(80.0)), "rad");
  optional("entry_angle", entry, Range::openHigh(0.0, units::TWO_PI), "rad");
  optional("exit_angle", exit, Range::openLow(0.0, units::TWO_PI), "rad");
  optional("feed_per_tooth", feed_per_tooth, Range::openLow(0.0, 0.01), "m");
  optional("overhang", overhang, Range::closed(0.25, 4.0), "1");
  optional("axial_depth", axial_depth, Range::openLow(0.0, 1.0), "m");
  require("speeds", speeds, Range::closed(0, 1000));
  require(speeds != 1, "speeds", speeds, "0 or at least 2");
}

// With q of unit modal mass the compliance of a mode is input x output / w^2.
std::vector<SystemMode> withOverhang(std::vector<SystemMode> modes, double overhang) {
  const double frequency = 1.0 / (overhang * overhang);
  const double gain = std::sqrt(overhang * overhang * overhang) * frequency;
  for (SystemMode& mode : modes) {
    mode.frequency *= frequency;
    for (std::size_t a = 0; a < 2; ++a) {
      mode.input[a] *= gain;
      mode.output[a] *= gain;
    }
  }
  return modes;
}

int dominantMode(const std::vector<SystemMode>& modes, double frequency) {
  int found = -1;
  double largest = 0.0;
  if (std::isnan(frequency)) return found;
  for (std::size_t k = 0; k < modes.size(); ++k) {
    const auto h = receptance({modes[k]}, frequency);
    const double size = std::sqrt(std::norm(h[0]) + std::norm(h[1]) + std::norm(h[2]) + std::norm(h[3]));
    if (!(size > largest)) continue;
    largest = size;
    found = static_cast<int>(k);
  }
  return found;
}

WhatIfChart whatIfChart(const ChartCut& cut, const MeasuredMachine& machine, const WhatIf& request) {
  request.validate();
  ChartCut other = cut;
  const auto change = [](double& value, double requested) {
    if (!std::isnan(requested)) value = requested;
  };
  change(other.tool.helix, request.helix);
  const bool other_teeth = request.teeth > 0 && request.teeth != cut.tool.teeth;
  if (!std::isnan(request.helix) || other_teeth) other.tool.edge.helix.clear();
  change(other.parameters.entry, request.entry);
  change(other.parameters.exit, request.exit);
  change(other.parameters.feed_per_tooth, request.feed_per_tooth);
  if (other_teeth) {
    other.tool.teeth = request.teeth;
    other.tool.pitch.clear();
  }
  other.parameters.validate();
  std::optional<RegenerativeSystem> system = machine.system(other);
  if (!system) throw Error("no chart yet, missing: modes in x and y or the tangential coefficient");
  if (!std::isnan(request.overhang)) {
    // The modes of the workpiece follow those of the tool.
    const std::vector<SystemMode> workpiece = systemModes(other.workpiece.x, other.workpiece.y);
    system->modes.resize(system->modes.size() - workpiece.size());
    system->modes = withOverhang(system->modes, request.overhang);
    system->modes.insert(system->modes.end(), workpiece.begin(), workpiece.end());
  }
  const int count = request.speeds > 0 ? request.speeds : WHAT_IF.speeds;
  std::vector<double> speeds;
  for (int i = 0; i < count; ++i)
    speeds.push_back(cut.parameters.speed_low +
                     (cut.parameters.speed_high - cut.parameters.speed_low) * i / (count - 1));
  WhatIfChart chart;
  // Limits far beyond the requested depth would take most of the time.
  const double all = cut.parameters.max_depth / (1.0 - cut.parameters.depth_margin);
  const double deepest = std::isnan(request.axial_depth)
                             ? all
                             : std::min(all, std::max(WHAT_IF.least_depth, 3.0 * request.axial_depth));
  chart.limit = limitsByContinuation(*system, speeds, deepest);
  for (std::size_t k = 0; k < system->modes.size(); ++k) {
    const SystemMode& mode = system->modes[k];
    const bool along_x = std::abs(mode.output[0]) >= std::abs(mode.output[1]);
    chart.modes.push_back((along_x ? "x " : "y ") + std::to_string(std::lround(mode.frequency)) + " Hz");
  }
  const SpindleLoad load(other, machine.coefficients());
  int stable = 0;
  for (int i = 0; i < count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    chart.mode.push_back(dominantMode(system->modes, chart.limit.chatter_frequency[k]));
    const auto [torque, power] = load.limits(speeds[k]);
    chart.torque_depth_limit.push_back(torque);
    chart.power_depth_limit.push_back(power);
    stable += request.axial_depth < chart.limit.depth[k];
  }
  if (!std::isnan(request.axial_depth)) chart.stable_share = static_cast<double>(stable) / count;
  if (request.spread) addSpread(machine.measuredSpread(other, *system), chart);
  return chart;
}

}  // namespace smartmill::stability
