#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"

namespace smartmill::discrepancy {

/// Vibration that a cut excites by itself: forces that do not come again with the revolution.
struct Chatter {
  double frequency = 0.0;  ///< [Hz] of the strongest line that is not periodic
  double amplitude = 0.0;  ///< [N] of that line
  double share = 0.0;      ///< [1] RMS of what is not periodic over that of the force about its mean
};

/// [1] of a cut's force about its mean: above it what does not come again with the revolution is chatter.
constexpr double CHATTER_SHARE = 0.25;

/// Looks at the second half of the cut, where transients of the entry are over. A chattering cut lies at a
/// phase that nothing but its own past tells, so no model that runs freely follows it sample by sample.
/// @param first_cut first sample in cut
/// @return empty: fx and fy repeat with the spindle, or are too short to tell
std::optional<Chatter> findChatter(const Record& record, const CampaignTest& test, std::size_t first_cut);

}  // namespace smartmill::discrepancy
