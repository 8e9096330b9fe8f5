#pragma once

#include <cstdint>
#include <deque>
#include <utility>
#include <vector>

#include "smartmill_core/signal/streams.h"

namespace smartmill::kalman {

/// Running indices of samples that are not a measurement; their compensated force is NaN.
class InvalidSamples {
 public:
  /// @param first_index of the block @param invalid a flag per sample of the block
  void add(std::uint64_t first_index, const std::vector<bool>& invalid);
  /// Sets the invalid samples of a block to NaN. Blocks come in the order of their index.
  void apply(ForceBlock& block);
  void clear() { ranges_.clear(); }

 private:
  std::deque<std::pair<std::uint64_t, std::uint64_t>> ranges_;  // [first, last)
};

}  // namespace smartmill::kalman
