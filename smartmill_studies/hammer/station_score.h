#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "smartmill_core/signal/frequency_response.h"

namespace smartmill::hammer {

constexpr double BAND_LOW = 250.0, BAND_HIGH = 4900.0;  ///< [Hz] of the scored modes and lines

/// Settings of the study's measurements.
struct StationStudy {
  std::uint64_t seed = 1;
  int hits = 10;          ///< [1] per measurement
  bool opposite = false;  ///< the sensor is opposite the hammer
};

/// Curves of figures 4.5 to 4.8 of the thesis, on the frequency lines of the measurement; empty if it failed.
struct StationFrfs {
  FrequencyResponse direct;    ///< true, at the tip
  FrequencyResponse across;    ///< true, from the hammer's height to the sensor's
  FrequencyResponse measured;  ///< from the hammer's height to the sensor's
  FrequencyResponse thesis;    ///< the same times eq. 4.44
  FrequencyResponse tip;       ///< receptance coupling
};

/// Draws the machine with a number, measures it and compares the result with the truth. @return one line of
/// the table
/// @param frfs filled if not null
nlohmann::json runStation(const StationStudy& study, int number, StationFrfs* frfs = nullptr);

/// Statistics over many lines.
nlohmann::json scoreStations(const std::vector<nlohmann::json>& lines);

}  // namespace smartmill::hammer
