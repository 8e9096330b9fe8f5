#pragma once

namespace smartmill::names {

// Services of the first connection of instruments, relative to the namespace /smartmill.
constexpr const char* TRY_INSTRUMENT = "daq/try_instrument";
constexpr const char* CALIBRATE_CHANNEL = "daq/calibrate_channel";

}  // namespace smartmill::names
