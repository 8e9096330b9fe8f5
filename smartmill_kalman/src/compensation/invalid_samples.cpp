#include "smartmill_kalman/compensation/invalid_samples.h"

#include <algorithm>

namespace smartmill::kalman {

void InvalidSamples::add(std::uint64_t first_index, const std::vector<bool>& invalid) {
  for (std::size_t i = 0; i < invalid.size(); ++i) {
    if (!invalid[i]) continue;
    const std::uint64_t index = first_index + i;
    if (!ranges_.empty() && ranges_.back().second == index) {
      ++ranges_.back().second;
    } else {
      ranges_.emplace_back(index, index + 1);
    }
  }
}

void InvalidSamples::apply(ForceBlock& block) {
  const std::uint64_t begin = block.first_index, end = begin + block.force[0].size();
  while (!ranges_.empty() && ranges_.front().second <= begin) ranges_.pop_front();
  for (const auto& [first, last] : ranges_) {
    for (std::uint64_t i = std::max(first, begin); i < std::min(last, end); ++i) {
      for (auto& force : block.force) force[i - begin] = NOT_A_NUMBER;
    }
  }
}

}  // namespace smartmill::kalman
