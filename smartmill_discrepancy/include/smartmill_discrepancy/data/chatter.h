#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"

namespace smartmill::discrepancy {

/// Self-excited vibration of a cut: forces that are not synchronous with the spindle.
struct Chatter {
  double frequency = 0.0;  ///< [Hz] of the strongest asynchronous line
  double amplitude = 0.0;  ///< [N] of that line
  double share = 0.0;      ///< [1] RMS of the asynchronous part over the standard deviation of the force
};

/// [1] of the standard deviation of a cut's force: an asynchronous part above it is chatter.
constexpr double CHATTER_SHARE = 0.25;

/// Uses the second half of the cut, after the transients of the entry. The phase of chatter depends only on
/// its own past, so no free simulation follows a chattering cut sample by sample.
/// @param first_cut first sample in cut
/// @return empty: fx and fy are synchronous with the spindle, or too short to decide
std::optional<Chatter> findChatter(const Record& record, const CampaignTest& test, std::size_t first_cut);

}  // namespace smartmill::discrepancy
