#pragma once

#include <nlohmann/json.hpp>

#include "hammer/station_score.h"

namespace smartmill::hammer {

/// Measures one drawn machine again and again, from the search of the flute on, nothing but the noise, the
/// blows and where the spindle happens to stand other; holds what the runs differ by against what they state.
/// One line: `scatter` [1] rms over the band's lines of the runs' deviation over the stated one, less a scale
/// a run, which is the sensor's; `within` [1] share of the lines whose two deviations are within a factor of
/// 1.5; `modes`, of each that all runs tell: frequency and damping's deviation over the stated one.
/// @throws Error when fewer than three runs end with an answer
nlohmann::json tapScatter(const StationStudy& study, int number, int repeats);

}  // namespace smartmill::hammer
