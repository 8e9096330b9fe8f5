#pragma once

#include <array>
#include <deque>
#include <utility>

#include "smartmill_kalman/compensation/harmonic_compensation.h"
#include "smartmill_kalman/filter/fixed_lag_smoother.h"

namespace smartmill::kalman {

/// HarmonicCompensation with a fixed-lag smoother per axis: a block is published once the samples up to
/// `lag` after it have been filtered.
class FixedLagCompensation : public HarmonicCompensation {
 public:
  FixedLagCompensation(const CompensationParameters& parameters, ForceOutputs outputs);

  void flush() override;
  void reset() override;

 protected:
  double step(std::size_t axis, HarmonicFilter& filter, double measured) override;
  void publish(const ForceBlock& measured, ForceBlock&& compensated) override;

 private:
  void publishOldest();

  double lag_;  // [s]
  std::array<FixedLagSmoother, 3> smoothers_;
  std::deque<std::pair<ForceBlock, ForceBlock>> pending_;  // measured, causal
};

}  // namespace smartmill::kalman
