#pragma once

#include <array>
#include <optional>
#include <vector>

#include "smartmill_core/signal/streams.h"
#include "smartmill_kalman/filter/harmonic_filter.h"
#include "smartmill_kalman/following/mode_follower.h"

namespace smartmill::kalman {

/// ModeFollower on the harmonic filters of x and y during one cut: takes their harmonics every few
/// revolutions, relative to the angle of tooth 1.
class HarmonicModeFollower {
 public:
  /// @param revolutions between two updates @param memory_revolutions of the settled filters
  HarmonicModeFollower(const CuttingCondition& cut, int harmonics, const ModeFollowerParameters& parameters,
                       int revolutions, double memory_revolutions);

  /// @param now [s] @param spindle angle and speed, newest @param noise_rms [N] of one sample, larger of x, y
  /// @return shifted modes of x and y; nothing when it is too early, the filters have not settled, or the
  /// sensor explains the harmonics.
  std::optional<ModeFollower::Update> update(double now, const SpindleAngle& spindle,
                                             const std::vector<HarmonicFilter>& filters,
                                             const std::array<ModalModel, 2>& sensor, double noise_rms,
                                             double sample_rate);

 private:
  ModeFollower follower_;
  int revolutions_;
  double memory_revolutions_;
  double next_update_ = 0.0;  // [s] 0: not scheduled
};

}  // namespace smartmill::kalman
