#pragma once

#include <functional>
#include <string>

#include "smartmill_launch/report/session_report.h"

namespace smartmill::report {

/// Reads the results and the cuts of a recorded session. @throws Error naming the bag.
SessionRecording readSession(const std::string& bag, const std::function<void(double)>& progress);

}  // namespace smartmill::report
