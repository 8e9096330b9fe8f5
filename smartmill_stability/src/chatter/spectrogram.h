#pragma once

#include <vector>

#include "smartmill_stability/chatter/recording.h"

namespace smartmill::stability {

/// Spectrogram of a recording with a Blackman-Harris window, by half a window: the side lobes of strong
/// harmonics stay below chatter lines. @param window [s] @param highest [Hz]
Spectrogram spectrogramOf(const Recording& recording, double window, double highest);

/// Mean power of each line over the windows with more than half of the mean power: the cut, where there is
/// one. @return [line]
std::vector<double> loudPower(const Spectrogram& spectrogram);

/// The recording at a multiple of its rate, by its Fourier transform: nothing is added above half of the
/// original rate. @param factor 2 or more
Recording atHigherRate(const Recording& recording, int factor);

}  // namespace smartmill::stability
