#pragma once

#include <cstdint>
#include <string>

#include <nlohmann/json_fwd.hpp>

namespace smartmill::discrepancy {

/// Fits a campaign whose nominal model is the truth from nominal values far off it: cutting coefficients,
/// damping and stiffness of the tool times 0.5 .. 1.5, its frequencies 2 % (uniform), stated as uncertain by
/// 30 and 1.2 %. What the campaign hides (its truth.yaml) is given.
/// @param chattering adds a cut of the deepest one's kind that the plant takes so deep that it chatters
/// @return case, campaign, chattering (cuts that are fitted in spite of it), named (should be nothing),
/// values (coefficients and modes of the tool), within (of them, at most 2 deviations off), largest (of their
/// distances [standard deviations]), distance (of all together, by their covariance, root of the mean square
/// [standard deviations]), right (at most 2, and nothing named), gap_before, gap_after, heldout_after,
/// seconds; refused: why, instead
nlohmann::json runStart(const std::string& campaign, bool chattering, std::uint64_t seed, int number);

}  // namespace smartmill::discrepancy
