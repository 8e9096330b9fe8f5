#pragma once

#include <cstddef>
#include <deque>
#include <memory>
#include <vector>

#include "smartmill_kalman/filter/harmonic_filter.h"

namespace smartmill::kalman {

/// Fixed-lag smoother of one axis (modified Bryson-Frazier, as HarmonicFilter::smooth): keeps the innovations
/// of the causal filter and estimates a force from the samples up to `lag` after it. The backward pass stops
/// at an abrupt change of the force (tool entry): later samples carry no information about the force before
/// it. The backward pass of a block of B samples costs 1 + lag / B filter steps per sample.
class FixedLagSmoother {
 public:
  /// Filters one sample; one that is not finite is replaced by the prediction. @return the causal force [N]
  double step(HarmonicFilter& filter, double measured);

  /// Samples that have been filtered and not yet taken.
  std::size_t pending() const { return samples_.size(); }

  /// Removes the oldest `count` samples. @return their forces [N], estimated from all samples so far
  std::vector<double> takeSmoothed(std::size_t count);

 private:
  struct Sample {
    double predicted = 0.0, innovation = 0.0;  // [N]
    std::size_t level = 0;
    bool is_measured = false;
    bool is_change = false;  // the backward pass stops here
    std::shared_ptr<const HarmonicSmoother> design;
  };
  std::deque<Sample> samples_;
  std::size_t restarts_ = 0;
};

}  // namespace smartmill::kalman
