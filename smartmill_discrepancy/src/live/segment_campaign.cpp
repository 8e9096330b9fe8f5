#include "smartmill_discrepancy/live/segment_campaign.h"

#include <algorithm>

namespace smartmill::discrepancy {

void SegmentCampaign::add(const RecordSegment& segment) {
  const auto earlier = std::find_if(segments_.begin(), segments_.end(), [&](const RecordSegment& other) {
    return other.test.name == segment.test.name;
  });
  if (earlier == segments_.end()) {
    segments_.push_back(segment);
  } else {
    *earlier = segment;
  }
}

std::size_t SegmentCampaign::write(const MachineModel& model, const LiveGapOptions& options,
                                   const std::string& folder,
                                   const std::function<void(const std::string&)>& progress) const {
  std::size_t tests = 0;
  for (const RecordSegment& segment : segments_) {
    if (model.force_sensor.noise_rms && liveGap(model, segment, options).near_limit) {
      progress(segment.test.name + ": omitted, near the stability limit of the model");
      continue;
    }
    recordSegment(model, segment, folder);
    ++tests;
  }
  return tests;
}

}  // namespace smartmill::discrepancy
