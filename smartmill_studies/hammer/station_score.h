#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "smartmill_core/signal/frequency_response.h"

namespace smartmill::hammer {

constexpr double BAND_LOW = 250.0, BAND_HIGH = 4900.0;  ///< [Hz] of the modes and lines that count

/// How the study measures; a run is of one of them.
struct StationStudy {
  std::uint64_t seed = 1;
  int hits = 10;  ///< [1] a measurement
};

/// What the thesis's figures 4.5 to 4.8 compare, on the lines of the measurement; empty: it failed.
struct StationFrfs {
  FrequencyResponse direct;    ///< true, at the tip
  FrequencyResponse across;    ///< true, from the hammer's height to the sensor's
  FrequencyResponse measured;  ///< from the hammer's height to the sensor's
  FrequencyResponse thesis;    ///< the same times eq. 4.44
  FrequencyResponse tip;       ///< spindle and tool apart
};

/// Draws the machine of that number, measures it and holds the answer against its truth; one line of the
/// table.
/// @param frfs filled where it is given
nlohmann::json runStation(const StationStudy& study, int number, StationFrfs* frfs = nullptr);

/// Figures over many lines.
nlohmann::json scoreStations(const std::vector<nlohmann::json>& lines);

}  // namespace smartmill::hammer
