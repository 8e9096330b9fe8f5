#pragma once

#include <cstddef>
#include <functional>
#include <string>

#include "smartmill_loadmeter/motor/axis_drive_recorder.h"

namespace smartmill::loadmeter {

/// Collects the moves of a recording. @param progress gets the share read, 0..1. @return number of moves.
/// @throws Error naming the file.
std::size_t readAxisMoves(const std::string& recording, AxisDriveRecorder& recorder,
                          const std::function<void(double)>& progress = {});

}  // namespace smartmill::loadmeter
