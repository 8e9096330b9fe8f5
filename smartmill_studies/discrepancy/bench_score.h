#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

namespace smartmill::discrepancy {

/// Prints the number of correct cases of each kind (rigid and vibrating separately), held-out gaps compared
/// with the plant's floor, and the parameters within their 95 % intervals. Draws confusion.png and
/// reliability.png.
/// @param lines of runBenchCase()
void scoreBench(const std::vector<nlohmann::json>& lines, const std::string& folder);

}  // namespace smartmill::discrepancy
