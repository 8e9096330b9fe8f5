#include "recordings/bag_campaign.h"

#include <algorithm>
#include <vector>

#include "node/monitor_parameters.h"
#include "node/wiring.h"
#include "smartmill_core/error.h"
#include "smartmill_discrepancy/live/live_gap.h"
#include "smartmill_recording/recording_reader.h"

namespace smartmill::discrepancy {

Campaign campaignOfBag(const std::string& bag, const std::string& model_file, const std::string& folder,
                       const std::function<void(const std::string&)>& progress) {
  const MonitorParameters parameters;
  const MachineModel model = readMachineModel(model_file);
  std::vector<Stretch> chosen;
  SegmentPipeline stretches(parameters.stretch, parameters.hold_back, [&](const Stretch& stretch) {
    const auto same = [&](const Stretch& other) { return other.test.name == stretch.test.name; };
    const auto earlier = std::find_if(chosen.begin(), chosen.end(), same);
    if (earlier == chosen.end()) {
      chosen.push_back(stretch);
    } else {
      *earlier = stretch;
    }
  });
  RecordingReader reader(bag);
  connect(reader, stretches);
  reader.run();
  stretches.flush();
  bool recorded = false;
  for (const Stretch& stretch : chosen) {
    if (model.force_sensor.noise_rms && liveGap(model, stretch, parameters.gap).at_the_edge) {
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
