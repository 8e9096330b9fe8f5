#include "recordings/bag_campaign.h"

#include <algorithm>
#include <vector>

#include "node/monitor_parameters.h"
#include "node/wiring.h"
#include "smartmill_core/error.h"
#include "smartmill_core/names.h"
#include "smartmill_discrepancy/live/live_gap.h"
#include "smartmill_recording/recording_reader.h"

namespace smartmill::discrepancy {
Campaign campaignOfBag(const std::string& bag, const std::string& model_file, const std::string& folder,
                       const std::function<void(const std::string&)>& progress) {
  MonitorParameters parameters;
  RecordingReader reader(bag);
  if (!reader.has(names::DYNAMOMETER) && reader.has(names::FORCE_COMPENSATED)) {
    parameters.forces = "compensated";
    progress("compared: force/compensated, since the recording has no daq/dynamometer");
  }
  const MachineModel model = comparedModel(readMachineModel(model_file), parameters.compared());
  std::vector<RecordSegment> chosen;
  const auto choose = [&](const RecordSegment& segment) {
    const auto same = [&](const RecordSegment& other) { return other.test.name == segment.test.name; };
    const auto earlier = std::find_if(chosen.begin(), chosen.end(), same);
    if (earlier == chosen.end()) {
      chosen.push_back(segment);
    } else {
      *earlier = segment;
    }
  };
  SegmentPipeline segments(parameters.segment, parameters.compared(), parameters.hold_back, choose);
  connect(reader, segments);
  reader.run();
  segments.flush();
  bool recorded = false;
  for (const RecordSegment& segment : chosen) {
    if (model.force_sensor.noise_rms && liveGap(model, segment, parameters.gapOptions()).near_limit) {
      progress(segment.test.name + ": omitted, near the stability limit of the model");
      continue;
    }
    recordSegment(model, segment, folder);
    recorded = true;
  }
  if (!recorded) throw Error(bag + ": expected a steady segment of 0.3 s with a cutting condition");
  return readCampaign(folder);
}

}  // namespace smartmill::discrepancy
