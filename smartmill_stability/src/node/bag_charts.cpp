#include "node/bag_charts.h"

#include "node/wiring.h"
#include "smartmill_core/error.h"
#include "smartmill_ros/bag_reader.h"

namespace smartmill::stability {

BagCharts chartsFromBag(const std::string& path, const MachineModel& model, const NodeParameters& parameters,
                        const std::function<void(double)>& progress) {
  BagCharts found;
  ChartMaker maker(parameters.chart, model);
  SortedDetection detection(parameters.chatter, parameters.hold_back,
                            [&](const ChatterState& state) { found.states.push_back(state); });
  BagReader bag(path);
  connectMeasured(bag, [&](const auto& measured) { maker.handle(measured); });
  feed<smartmill_msgs::CuttingCondition>(bag, names::CUTTING_CONDITION, detection);
  connect(bag, parameters, detection);
  bag.run(progress);
  detection.flush();
  found.missing = maker.missing();
  if (found.missing.empty()) found.chart = maker.chart();
  return found;
}

}  // namespace smartmill::stability
