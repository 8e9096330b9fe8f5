#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "smartmill_core/signal/streams.h"
#include "smartmill_kalman/compensation/force_compensation.h"
#include "smartmill_kalman/filter/matrix_inverse.h"

namespace smartmill::kalman {

/// Blocks of a sensor of 3 or 6 channels through MatrixInverse: blocks come out late by its latency, with
/// their own index and stamp. Needs neither a tachometer nor a periodic force.
class MatrixCompensation {
 public:
  MatrixCompensation(const MatrixInverse& inverse, bool measures_workpiece, ForceCompensation::Output output);

  /// @throws Error when a channel is missing, in another unit or at another sample rate than the taps'.
  void handle(const SampleBlock& block);
  /// End of data: what waits comes out with silence after it.
  void flush();
  void reset();
  std::size_t gaps() const { return gaps_; }
  std::size_t notFinite() const { return not_finite_; }

 private:
  std::vector<std::size_t> columnsOf(const SampleBlock& block) const;
  void release();

  MatrixInverse inverse_;
  double sign_;
  ForceCompensation::Output output_;
  std::optional<std::uint64_t> next_index_;
  std::deque<ForceBlock> waiting_;           // as measured
  std::array<std::deque<double>, 3> ready_;  // [N]
  std::size_t early_ = 0, settling_ = 0;     // samples that no block has asked for, that still settle
  std::vector<double> last_;                 // of each channel
  std::size_t gaps_ = 0, not_finite_ = 0;
};

}  // namespace smartmill::kalman
