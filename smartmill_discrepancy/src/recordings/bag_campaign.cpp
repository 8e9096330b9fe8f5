#include "smartmill_discrepancy/recordings/bag_campaign.h"

#include "node/monitor_parameters.h"
#include "node/wiring.h"
#include "smartmill_core/error.h"
#include "smartmill_core/names.h"
#include "smartmill_discrepancy/live/segment_campaign.h"
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
  SegmentCampaign campaign;
  SegmentPipeline segments(parameters.segment, parameters.compared(), parameters.hold_back,
                           [&](const RecordSegment& segment) { campaign.add(segment); });
  connect(reader, segments);
  reader.run();
  segments.flush();
  if (campaign.write(model, parameters.gapOptions(), folder, progress) == 0)
    throw Error(bag + ": expected a steady segment of 0.3 s with a cutting condition");
  return readCampaign(folder);
}

}  // namespace smartmill::discrepancy
