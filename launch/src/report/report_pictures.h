#pragma once

#include <optional>
#include <string>

#include "smartmill_launch/report/session_report.h"

namespace smartmill::report {

/// Draws frf.png, chart.png and force.png into a folder with gnuplot, as far as the recording has their data,
/// and writes the data as tables to its subfolder `data`. @return names of the pictures drawn
/// @throws Error if the folder cannot be written or gnuplot fails.
std::vector<std::string> drawPictures(const SessionRecording& recording, const Report& report,
                                      const std::optional<StabilityChart>& true_chart,
                                      const std::string& folder);

}  // namespace smartmill::report
