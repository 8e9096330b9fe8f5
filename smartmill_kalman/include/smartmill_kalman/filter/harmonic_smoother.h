#pragma once

#include <cstddef>
#include <vector>

#include "smartmill_kalman/filter/harmonic_pairs.h"

namespace smartmill::kalman {

/// Backward pass of a smoother over the steps of a HarmonicFilter, with data that is constant while sensor,
/// speed and gains stay.
struct HarmonicSmoother {
  using GainBatch = HarmonicPairs::GainBatch;

  std::vector<HarmonicPairs::PairBatch> batches;         ///< re, im unused
  std::vector<std::vector<GainBatch>> gains, smoothing;  ///< each level
  std::vector<double> variance, force_gain;              ///< [N2], [1] each level

  /// One sample. @param level, innovation of the sample's step @param is_measured false: it was predicted
  /// @param lambda adjoint of the next sample, replaced by that of this one @return correction of the
  /// predicted force [N]
  double backward(std::size_t level, double innovation, bool is_measured,
                  std::vector<GainBatch>& lambda) const;
};

}  // namespace smartmill::kalman
