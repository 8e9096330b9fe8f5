#include "recordings/bag_charts.h"

#include <type_traits>

#include "node/wiring.h"
#include "smartmill_core/error.h"
#include "smartmill_recording/recording_reader.h"

namespace smartmill::stability {

BagCharts chartsFromBag(const std::string& path, const MachineModel& model, const NodeParameters& parameters,
                        const std::function<void(double)>& progress) {
  BagCharts found;
  ChartMaker maker(parameters.chart, model);
  DetectionPipeline detection(parameters.chatter, parameters.hold_back,
                              [&](const ChatterState& state) { found.states.push_back(state); });
  RecordingReader bag(path);
  std::optional<IdentifiedForceCurves> curves;
  connectMeasured(bag, [&](const auto& measured) {
    if constexpr (std::is_same_v<std::decay_t<decltype(measured)>, IdentifiedForceCurves>) {
      curves = measured;
    } else {
      maker.handle(measured);
    }
  });
  feed<CuttingCondition>(bag, names::CUTTING_CONDITION, detection);
  connect(bag, parameters, detection);
  bag.run(progress);
  detection.flush();
  found.missing = maker.missing();
  if (found.missing.empty()) {
    found.chart = maker.chart();
    found.solver = maker.solver();
  }
  if (!parameters.force_curve.empty()) {
    curves.emplace();
    curves->curves = readForceCurves(parameters.force_curve);
    curves->teeth = maker.teeth();
  }
  if (curves) found.bistable = bistableChart(maker, parameters.chart, *curves, parameters.bistable_speeds);
  return found;
}

}  // namespace smartmill::stability
