#pragma once

#include <nlohmann/json.hpp>

#include "hammer/station_score.h"

namespace smartmill::hammer {

/// Repeats the measurement of one random machine from the search of the flute on, with new noise, hits and
/// initial spindle angle, and compares the scatter of the runs with their stated uncertainty. One line:
/// `scatter` [1] RMS over the lines of the band of the runs' standard deviation over the stated one, without
/// one scale per run (that of the sensor); `within` [1] share of the lines whose two standard deviations
/// agree within a factor of 1.5; `modes`, for each mode found in all runs: standard deviation of frequency
/// and damping over the stated one.
/// @throws Error when fewer than three runs have a result
nlohmann::json tapScatter(const StationStudy& study, int number, int repeats);

}  // namespace smartmill::hammer
