#pragma once

#include <cstdint>

#include <nlohmann/json_fwd.hpp>

namespace smartmill::loadmeter {

/// One random shop of 50 machines, 6 materials, 3 tools: machines differ by 1..6 %, their batches by 0.5..2
/// %, tools by 3..15 %, cuts by 1..3 % of which 1 % is stated. In three of four shops two machines are
/// outliers, off by 12..30 %; a third of the machines have no cut in the last material, and then make four
/// cuts in it with their first tool.
/// @return one line: errors of the first prediction by the fleet and by the machine alone, their z-scores,
/// the same after each cut, outliers found, other machines named, cuts until a new outlier is named
nlohmann::json runShop(std::uint64_t seed, int number);

}  // namespace smartmill::loadmeter
