#pragma once

#include <functional>
#include <string>

#include "smartmill_core/campaign/campaign.h"

namespace smartmill::discrepancy {

/// Makes a campaign of the steady stretches of a recorded bag, the last of each cutting condition, in a
/// folder; what the model does not follow because it is about to chatter is left out.
/// @param progress told what was left out, a line each
/// @throws Error on a bad bag or one without a steady stretch.
Campaign campaignOfBag(const std::string& bag, const std::string& model_file, const std::string& folder,
                       const std::function<void(const std::string&)>& progress);

}  // namespace smartmill::discrepancy
