#pragma once

#include <string>
#include <vector>

#include "smartmill_daq/acquisition/acquisition.h"

namespace smartmill::daq {

/// One line about the whole: alive or why not.
std::string summaryOf(const InstrumentState& state);
/// Whether samples come and all is well.
bool isWell(const InstrumentState& state);
/// "drift +30.02 ppm (sd 0.05), offset -0.0012 s (sd 2.1 us), jitter 310 us".
std::string clockText(const ClockState& clock);
/// "1 gap (512 samples), 2 clipping (40 samples)"; empty: none.
std::string faultText(const FaultLog& faults);
/// "fx: mean 1.2 N, rms 0.5 N, peak 12 % of the range, 0 clipped".
std::string levelText(const Channel& channel, const ChannelLevel& level);

}  // namespace smartmill::daq
