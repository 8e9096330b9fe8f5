#include "smartmill_kalman/sensor/stuck_channel.h"

namespace smartmill::kalman {

void StuckChannel::handle(const SampleBlock& block) {
  const std::size_t channels = block.channels.size();
  if (block.size() == 0) return;
  if (last_.size() != channels || block.stamp < changed_at_.front()) {
    last_.assign(channels, NOT_A_NUMBER);
    changed_at_.assign(channels, block.stamp);
  }
  const double end = block.timeOf(block.size() - 1);
  duration_ = 0.0;
  for (std::size_t c = 0; c < channels; ++c) {
    for (std::size_t i = 0; i < block.size(); ++i) {
      if (block.at(i, c) == last_[c]) continue;  // a NaN differs: it is counted as such
      last_[c] = block.at(i, c);
      changed_at_[c] = block.timeOf(i);
    }
    if (end - changed_at_[c] <= duration_) continue;
    duration_ = end - changed_at_[c];
    channel_ = block.channels[c];
  }
}

}  // namespace smartmill::kalman
