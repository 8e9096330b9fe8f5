#pragma once

#include <cstdint>
#include <string>

#include <nlohmann/json_fwd.hpp>

namespace smartmill::discrepancy {

/// Fits a campaign whose nominal model is the truth from distant nominal values: cutting coefficients,
/// damping and stiffness of the tool times 0.5 .. 1.5, its frequencies 2 % (uniform), stated as uncertain by
/// 30 and 1.2 %. What the campaign hides (its truth.yaml) is given.
/// @param chattering adds a cut like the deepest one, deep enough that it chatters
/// @return case, campaign, chattering (fitted cuts that chatter), named (should be nothing),
/// values (number of coefficients and modal parameters), within (number of them within 2 standard
/// deviations), largest (largest error [standard deviations]), distance (root mean square error of all, by
/// their covariance [standard deviations]), right (distance at most 2 and no effect named), gap_before,
/// gap_after, heldout_after, seconds; or refused: the reason
nlohmann::json runStart(const std::string& campaign, bool chattering, std::uint64_t seed, int number);

}  // namespace smartmill::discrepancy
