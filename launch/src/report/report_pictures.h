#pragma once

#include <optional>
#include <string>

#include "smartmill_launch/report/session_report.h"

namespace smartmill::report {

/// Draws frf.png, chart.png and force.png into a folder with gnuplot, each where the recording has what it
/// shows; the data drawn stand as tables in the folder's `data/`. @return names of the pictures drawn
/// @throws Error when the folder cannot be written or gnuplot fails.
std::vector<std::string> drawPictures(const SessionRecording& recording, const Report& report,
                                      const std::optional<StabilityChart>& true_chart,
                                      const std::string& folder);

}  // namespace smartmill::report
