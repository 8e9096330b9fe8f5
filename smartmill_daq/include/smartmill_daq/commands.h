#pragma once

#include "smartmill_core/command.h"

namespace smartmill::daq {

/// Shift between two streams of a recording.
Command alignCommand();
/// Opens an instrument without ROS; level, clipping and clock once a second.
Command daqCommand();
/// Sensitivity of a channel from a record of a known quantity.
Command sensitivityCommand();

}  // namespace smartmill::daq
