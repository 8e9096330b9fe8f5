#pragma once

#include <string>
#include <vector>

#include "smartmill_core/signal/streams.h"

namespace smartmill::kalman {

/// The channel of a sensor whose samples have not changed for longest: a broken cable, a converter that has
/// stopped or a saturated amplifier gives no noise.
class StuckChannel {
 public:
  void handle(const SampleBlock& block);
  /// [s] since the last change of that channel; 0 before any block.
  double duration() const { return duration_; }
  const std::string& channel() const { return channel_; }

 private:
  std::vector<double> last_;        // sample of each channel
  std::vector<double> changed_at_;  // [s]
  std::string channel_;
  double duration_ = 0.0;
};

}  // namespace smartmill::kalman
