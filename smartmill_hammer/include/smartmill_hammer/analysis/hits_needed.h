#pragma once

#include "smartmill_core/signal/frequency_response.h"

namespace smartmill::hammer {

/// Precision of an FRF averaged over several hits, and the number of hits that a required precision needs.
struct HitsNeeded {
  double relative_std = 0.0;  ///< [1] rms of the lines' standard deviations over rms of the lines
  int hits = 0;               ///< averaged
  int needed = 0;             ///< the standard deviation falls with the root of their number (eq. 4.39)
  bool isReached() const { return needed > 0 && hits >= needed; }
};

/// @param low, high [Hz] band @param required_std [1] relative standard deviation, > 0
/// @throws Error when no line of the band states a standard deviation.
HitsNeeded hitsNeeded(const FrequencyResponse& frf, double low, double high, double required_std);

}  // namespace smartmill::hammer
