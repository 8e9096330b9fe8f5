#include "node/bag_charts.h"

#include "smartmill_core/error.h"
#include "smartmill_ros/bag_reader.h"
#include "smartmill_ros/conversions.h"

namespace smartmill::stability {

BagCharts chartsFromBag(const std::string& path, const MachineModel& model, const NodeParameters& parameters,
                        const std::function<void(double)>& progress) {
  BagCharts found;
  ChartMaker maker(parameters.chart, model);
  SortedDetection detection(parameters.chatter, parameters.hold_back,
                            [&](const ChatterState& state) { found.states.push_back(state); });
  BagReader bag(path);
  bag.on<smartmill_msgs::Frf>("tool/frf",
                              [&](const smartmill_msgs::Frf& m, double) { maker.handle(fromMsg(m)); });
  bag.on<smartmill_msgs::ModalModel>(
      "tool/modes", [&](const smartmill_msgs::ModalModel& m, double) { maker.handle(fromMsg(m)); });
  bag.on<smartmill_msgs::CuttingCoefficients>(
      "material/coefficients",
      [&](const smartmill_msgs::CuttingCoefficients& m, double) { maker.handle(fromMsg(m)); });
  bag.on<smartmill_msgs::CuttingCondition>("cut/condition", [&](const smartmill_msgs::CuttingCondition& m,
                                                                double) { detection.push(fromMsg(m)); });
  bag.on<smartmill_msgs::CncState>(
      "cnc/state", [&](const smartmill_msgs::CncState& m, double) { detection.push(fromMsg(m)); });
  bag.on<smartmill_msgs::SpindleAngle>(
      "spindle/angle", [&](const smartmill_msgs::SpindleAngle& m, double) { detection.push(fromMsg(m)); });
  bag.on<smartmill_msgs::ForceBlock>(
      "force/compensated", [&](const smartmill_msgs::ForceBlock& m, double) { detection.push(fromMsg(m)); });
  bag.run(progress);
  detection.flush();
  found.missing = maker.missing();
  if (found.missing.empty()) found.chart = maker.chart();
  return found;
}

}  // namespace smartmill::stability
