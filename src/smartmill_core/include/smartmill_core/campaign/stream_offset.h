#pragma once

#include <map>
#include <set>
#include <string>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"

namespace smartmill {

/// Groups of columns that one device records, possibly later than the other columns: force (fx, fy, fz),
/// controller (axis_*, current_*, load_meter), tool (tool_x, tool_y, displacement, acceleration).
const std::map<std::string, std::set<std::string>>& streamGroups();

/// The record with every column on the clock of the columns without an offset, cropped to the time that all
/// columns cover. The test's stream_offset states how much later each group is recorded. Columns are
/// interpolated with cubics.
/// @throws Error when no two samples are common to all columns.
Record aligned(const Record& record, const CampaignTest& test);

}  // namespace smartmill
