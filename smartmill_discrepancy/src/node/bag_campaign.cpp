#include "node/bag_campaign.h"

#include <algorithm>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_discrepancy/live/live_gap.h"
#include "smartmill_ros/bag_reader.h"
#include "smartmill_ros/conversions.h"

namespace smartmill::discrepancy {

Campaign campaignOfBag(const std::string& bag, const std::string& model_file, const std::string& folder,
                       const std::function<void(const std::string&)>& progress) {
  constexpr double HOLD_BACK = 0.05;
  const MachineModel model = readMachineModel(model_file);
  std::vector<Stretch> chosen;
  SortedStretches stretches(StretchParameters(), HOLD_BACK, [&](const Stretch& stretch) {
    const auto same = [&](const Stretch& other) { return other.test.name == stretch.test.name; };
    const auto earlier = std::find_if(chosen.begin(), chosen.end(), same);
    if (earlier == chosen.end()) {
      chosen.push_back(stretch);
    } else {
      *earlier = stretch;
    }
  });
  BagReader reader(bag);
  const auto follow = [&](const char* topic, auto message) {
    using Message = decltype(message);
    reader.on<Message>(topic, [&](const Message& m, double) { stretches.push(fromMsg(m)); });
  };
  follow("cut/condition", smartmill_msgs::CuttingCondition());
  follow("cnc/state", smartmill_msgs::CncState());
  follow("spindle/angle", smartmill_msgs::SpindleAngle());
  follow("daq/dynamometer", smartmill_msgs::SampleBlock());
  reader.run();
  stretches.flush();
  bool recorded = false;
  for (const Stretch& stretch : chosen) {
    if (model.force_sensor.noise_rms && liveGap(model, stretch, {}).at_the_edge) {
      progress(stretch.test.name + ": left out, the model's tool is about to chatter there");
      continue;
    }
    recordStretch(model, stretch, folder);
    recorded = true;
  }
  if (!recorded) throw Error(bag + ": no steady stretch of 0.3 s under a cutting condition");
  return readCampaign(folder);
}

}  // namespace smartmill::discrepancy
