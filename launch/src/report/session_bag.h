#pragma once

#include <functional>
#include <string>

#include "smartmill_launch/report/session_report.h"

namespace smartmill::report {

/// Reads what the report needs from a recorded session. Forces are kept of the cuts `verify_*` and
/// `resonance`.
/// @throws Error naming the bag.
SessionRecording readSession(const std::string& bag, const std::function<void(double)>& progress);

}  // namespace smartmill::report
