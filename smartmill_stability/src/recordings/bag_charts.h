#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "node/parameters.h"
#include "smartmill_stability/chart/bistable_chart.h"

namespace smartmill::stability {

/// What the node would have published.
struct BagCharts {
  std::optional<StabilityChart> chart;    ///< the last one
  std::string missing;                    ///< why there is none
  std::optional<BistableChart> bistable;  ///< by the last force curve
  std::vector<ChatterState> states;
};

/// Puts tool/frf, tool/modes, material/coefficients and the streams of the cuts in a bag through the classes
/// of the node. @throws Error as RecordingReader; when the data contradict each other.
BagCharts chartsFromBag(const std::string& path, const MachineModel& model, const NodeParameters& parameters,
                        const std::function<void(double)>& progress = {});

}  // namespace smartmill::stability
