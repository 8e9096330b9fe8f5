#pragma once

#include <cstddef>
#include <vector>

#include "smartmill_core/modal/hit_limits.h"

namespace smartmill {

/// Deviation of a freely decaying response from the prediction by its own past.
struct FreeDecayBreak {
  std::size_t sample = 0;  ///< 0: none
  double size = 0.0;       ///< [unit of the response] of the deviation
  bool sudden = false;     ///< a single sample, not a segment
};

/// Free decay of any modes is a sum of decaying sines, which linear prediction from the last samples predicts
/// to within the noise. The record is checked at its own rate and averaged over 4 and 16 samples, for slow
/// motions. @param from first sample after the contact @param noise of one sample
FreeDecayBreak freeDecayBreak(const std::vector<double>& response, std::size_t from, double noise,
                              const FreeDecayLimits& limits);

/// Unpredicted power of the samples begin .. end, relative to that of the ringing before them: near 1 for
/// beating modes, larger for other motion. 0: too few samples before.
double unpredictedRise(const std::vector<double>& response, std::size_t from, std::size_t begin,
                       std::size_t end, double noise, const FreeDecayLimits& limits);

}  // namespace smartmill
