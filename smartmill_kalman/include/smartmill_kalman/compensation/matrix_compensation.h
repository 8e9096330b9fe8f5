#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "smartmill_core/signal/streams.h"
#include "smartmill_kalman/compensation/compensation_method.h"
#include "smartmill_kalman/filter/matrix_inverse.h"

namespace smartmill::kalman {

/// Inverts the transfer matrix of a sensor of 3 or 6 channels (MatrixInverse). Blocks are published late by
/// its latency, with their own index and stamp. Requires neither a tachometer nor a periodic force.
class MatrixCompensation {
 public:
  MatrixCompensation(const MatrixInverse& inverse, bool measures_workpiece, ForceOutputs outputs);

  /// @throws Error when a channel is missing, in another unit or at another sample rate than the taps'.
  void check(const SampleBlock& block) const { columnsOf(block); }
  /// @throws Error as check().
  void handle(const SampleBlock& block);
  /// End of data: pending blocks are published, with zeros assumed after them.
  void flush();
  void reset();
  std::size_t gaps() const { return gaps_; }
  std::size_t notFinite() const { return not_finite_; }

 private:
  std::vector<std::size_t> columnsOf(const SampleBlock& block) const;
  void publishOldest();

  MatrixInverse inverse_;
  double sign_;
  ForceOutputs outputs_;
  std::optional<std::uint64_t> next_index_;
  std::deque<ForceBlock> pending_;           // as measured
  std::array<std::deque<double>, 3> ready_;  // [N]
  std::size_t discard_ = 0;                  // output samples before the first input sample
  std::size_t settling_samples_ = 0;
  std::vector<double> last_;  // valid sample of each channel
  std::size_t gaps_ = 0, not_finite_ = 0;
};

}  // namespace smartmill::kalman
