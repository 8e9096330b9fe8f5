#pragma once

#include <map>
#include <set>
#include <string>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"

namespace smartmill {

/// Groups of columns that one device records, and that may be recorded later than the rest: force (fx, fy,
/// fz), controller (axis_*, current_*, load_meter), tool (tool_x, tool_y, displacement, acceleration).
const std::map<std::string, std::set<std::string>>& streamGroups();

/// The record with every column on the clock of those without an offset, cropped to the time that all columns
/// cover; the test's stream_offset says how much later each group is recorded. Between samples columns are
/// interpolated with cubics.
/// @throws Error when no two samples are common to all columns.
Record aligned(const Record& record, const CampaignTest& test);

}  // namespace smartmill
