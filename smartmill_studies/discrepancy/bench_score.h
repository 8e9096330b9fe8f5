#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

namespace smartmill::discrepancy {

/// Prints how many cases of each kind were right, rigid and vibrating apart, held-out gaps against the
/// plant's own floor, how many parameters lie within their 95 % intervals; draws confusion.png and
/// reliability.png.
/// @param lines of runBenchCase()
void scoreBench(const std::vector<nlohmann::json>& lines, const std::string& folder);

}  // namespace smartmill::discrepancy
