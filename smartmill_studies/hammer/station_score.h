#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace smartmill::hammer {

/// How the study measures; a run is of one of them.
struct StationStudy {
  std::uint64_t seed = 1;
  int hits = 10;  ///< [1] a measurement
};

/// Draws the machine of that number, measures it and holds the answer against its truth; one line of the
/// table.
nlohmann::json runStation(const StationStudy& study, int number);

/// Figures over many lines.
nlohmann::json scoreStations(const std::vector<nlohmann::json>& lines);

}  // namespace smartmill::hammer
