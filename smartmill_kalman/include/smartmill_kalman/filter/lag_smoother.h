#pragma once

#include <cstddef>
#include <deque>
#include <memory>
#include <vector>

#include "smartmill_kalman/filter/harmonic_filter.h"

namespace smartmill::kalman {

/// Fixed-lag smoother of one axis: keeps what the causal filter has learnt from each sample (its innovation)
/// and goes back over it (modified Bryson-Frazier, as HarmonicFilter::smooth), so that a force is told from
/// the samples up to `lag` after it. A change of the force out of line with what was before (tool entry) is a
/// wall: nothing behind it says anything about the time before. Going back costs a block of B samples
/// 1 + lag / B times a step.
class LagSmoother {
 public:
  /// One sample, as HarmonicFilter::step; not finite: bridged. @return the causal force [N]
  double step(HarmonicFilter& filter, double measured);

  /// Samples taken and not yet told.
  std::size_t waiting() const { return samples_.size(); }

  /// Forces [N] of the oldest `count` samples, from all samples taken so far; they are forgotten here.
  std::vector<double> take(std::size_t count);

 private:
  struct Sample {
    double predicted = 0.0, innovation = 0.0;  // [N]
    std::size_t level = 0;
    bool seen = false, wall = false;  // wall: what comes from here on says nothing about the time before
    std::shared_ptr<const HarmonicFilter::Layout> layout;
  };
  std::deque<Sample> samples_;
  std::size_t restarts_ = 0;
};

}  // namespace smartmill::kalman
