#include "bag_campaign.h"

#include <set>

#include "smartmill_core/error.h"
#include "smartmill_discrepancy/live_gap.h"
#include "smartmill_ros/bag_reader.h"
#include "smartmill_ros/conversions.h"

namespace smartmill::discrepancy {

Campaign campaignOfBag(const std::string& bag, const std::string& model_file, const std::string& folder) {
  constexpr double LENGTH = 0.3, PATH_TOLERANCE = 1e-4, HOLD_BACK = 0.05;
  const MachineModel model = readMachineModel(model_file);
  std::set<std::string> taken;
  SortedStretches stretches(LENGTH, PATH_TOLERANCE, HOLD_BACK, [&](const Stretch& stretch) {
    if (taken.insert(stretch.test.name).second) recordStretch(model, stretch, folder);
  });
  BagReader reader(bag);
  reader.on<smartmill_msgs::CuttingCondition>("cut/condition", [&](const smartmill_msgs::CuttingCondition& m,
                                                                   double) { stretches.push(fromMsg(m)); });
  reader.on<smartmill_msgs::CncState>(
      "cnc/state", [&](const smartmill_msgs::CncState& m, double) { stretches.push(fromMsg(m)); });
  reader.on<smartmill_msgs::SpindleAngle>(
      "spindle/angle", [&](const smartmill_msgs::SpindleAngle& m, double) { stretches.push(fromMsg(m)); });
  reader.on<smartmill_msgs::SampleBlock>(
      "daq/dynamometer", [&](const smartmill_msgs::SampleBlock& m, double) { stretches.push(fromMsg(m)); });
  reader.run();
  stretches.flush();
  if (taken.empty()) throw Error(bag + ": no steady stretch of 0.3 s under a cutting condition");
  return readCampaign(folder);
}

}  // namespace smartmill::discrepancy
