#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "smartmill_discrepancy/live/live_gap.h"

namespace smartmill::discrepancy {

/// Campaign of a recorded or running production: of the last segments of all cutting conditions, those that
/// differ most in speed, feed, depth, arc, direction and time. Explain simulates each of them a thousand
/// times.
class SegmentCampaign {
 public:
  static constexpr std::size_t MOST_CUTS = 12, MOST_AIR = 3;

  void add(const RecordSegment& segment);
  /// Writes the campaign, without segments near the stability limit of the model.
  /// @param progress receives one line for each of these @return number of tests @throws Error.
  std::size_t write(const MachineModel& model, const LiveGapOptions& options, const std::string& folder,
                    const std::function<void(const std::string&)>& progress) const;

 private:
  std::vector<RecordSegment> segments_;
};

}  // namespace smartmill::discrepancy
