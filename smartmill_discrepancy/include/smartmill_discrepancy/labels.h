#pragma once

#include <string>
#include <vector>

#include "smartmill_discrepancy/dataset.h"

namespace smartmill::discrepancy {

/// What of a campaign is not as it is labelled, one line each, e.g. "fx and fy look swapped in tests slot_1,
/// slot_2": channels swapped, channel in another unit, spindle at another speed than stated, test with the
/// label of another. Compares with the nominal model; looks only for what would be far larger than any effect
/// of the catalogue.
std::vector<std::string> wrongLabels(const Dataset& data, int threads);

}  // namespace smartmill::discrepancy
