#include "smartmill_stability/chart/bistable_chart.h"

#include <algorithm>

namespace smartmill::stability {

std::optional<BistableChart> bistableChart(const ChartMaker& maker, const ChartParameters& parameters,
                                           const IdentifiedForceCurves& curves, int speeds) {
  const std::optional<RegenerativeSystem> system = maker.system({});
  if (!system || curves.teeth != maker.teeth() || speeds < 2) return std::nullopt;
  const ForceCurve& law = curves.curves.tangential;
  BistableChart chart;
  chart.stamp = curves.stamp;
  chart.tool = curves.tool;
  chart.material = curves.material;
  chart.entry = system->entry;
  chart.exit = system->exit;
  chart.feed = std::min(parameters.feed_per_tooth, law.knots.back());
  chart.mean_chip = meanChip(*system, chart.feed);
  chart.slope = law.slope(chart.mean_chip);
  std::vector<double> at;
  for (int k = 0; k < speeds; ++k)
    at.push_back(parameters.speed_low + (maker.highestSpeed() - parameters.speed_low) * k / (speeds - 1));
  chart.limits =
      bistableLimits(*system, curves.curves, chart.feed, Method::collocation, {}, at, parameters.max_depth);
  return chart;
}

}  // namespace smartmill::stability
