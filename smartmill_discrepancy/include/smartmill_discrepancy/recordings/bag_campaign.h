#pragma once

#include <functional>
#include <string>

#include "smartmill_core/campaign/campaign.h"

namespace smartmill::discrepancy {

/// Converts the last steady segment of each cutting condition of a bag into a campaign in a folder. Segments
/// near the model's stability limit are omitted.
/// @param progress receives one line per omitted segment
/// @throws Error on an invalid bag or one without a steady segment.
Campaign campaignOfBag(const std::string& bag, const std::string& model_file, const std::string& folder,
                       const std::function<void(const std::string&)>& progress);

}  // namespace smartmill::discrepancy
