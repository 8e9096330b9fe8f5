#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "node/parameters.h"
#include "smartmill_stability/chart/bistable_chart.h"

namespace smartmill::stability {

/// Results that the node publishes for the same data.
struct BagCharts {
  std::optional<StabilityChart> chart;    ///< from all inputs of the bag
  std::string solver;                     ///< of the chart, as ChartMaker::solver()
  std::string missing;                    ///< missing inputs, without a chart
  std::optional<BistableChart> bistable;  ///< for the last force curve
  std::vector<ChatterState> states;
};

/// Processes tool/frf, tool/modes, material/coefficients and the streams of the cuts of a bag with the
/// classes of the node. @throws Error as RecordingReader, and when inputs contradict each other.
BagCharts chartsFromBag(const std::string& path, const MachineModel& model, const NodeParameters& parameters,
                        const std::function<void(double)>& progress = {});

}  // namespace smartmill::stability
