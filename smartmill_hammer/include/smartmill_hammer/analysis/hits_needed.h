#pragma once

#include "smartmill_core/signal/frequency_response.h"

namespace smartmill {
namespace hammer {

/// How well an FRF of several hits is known, and how many hits an asked uncertainty needs.
struct HitsNeeded {
  double relative_std = 0.0;  ///< [1] rms of the lines' standard deviations over rms of the lines
  int hits = 0;               ///< averaged
  int needed = 0;  ///< for the asked uncertainty: it falls with the root of their number (eq. 4.39)
  bool enough() const { return needed > 0 && hits >= needed; }
};

/// @param low, high [Hz] band asked for @param asked [1] relative standard deviation, > 0
/// @throws Error when no line of the band states a standard deviation.
HitsNeeded hitsNeeded(const FrequencyResponse& frf, double low, double high, double asked);

}  // namespace hammer
}  // namespace smartmill
