#pragma once

#include <string>

#include "smartmill_core/campaign/campaign.h"

namespace smartmill::discrepancy {

/// Makes a campaign of the steady stretches of a recorded bag, the first of each cutting condition, in a
/// folder.
/// @throws Error on a bad bag or one without a steady stretch.
Campaign campaignOfBag(const std::string& bag, const std::string& model_file, const std::string& folder);

}  // namespace smartmill::discrepancy
