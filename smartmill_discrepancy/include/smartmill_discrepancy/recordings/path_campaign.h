#pragma once

#include <functional>
#include <string>

#include "smartmill_core/campaign/campaign.h"

namespace smartmill::discrepancy {

/// Converts the tests of kind path of a campaign into the steady cuts along their programs, as
/// SegmentCampaign chooses them, next to copies of the other tests. Start and cutting times of a path that
/// are not stated count from the beginning of its record.
/// @param model_file machine model with tool and workpiece @param progress receives a line for each path and
/// each omitted segment
/// @throws Error on a program that cannot be read or does not fit the stock, and on positions that do not
/// follow it.
Campaign campaignOfPaths(const Campaign& campaign, const std::string& model_file, const std::string& folder,
                         const std::function<void(const std::string&)>& progress);

}  // namespace smartmill::discrepancy
