#pragma once

#include <array>
#include <deque>
#include <optional>

#include "smartmill_core/signal/streams.h"
#include "smartmill_sim/controller/motion_state.h"

namespace smartmill::sim {

/// Motion of axes and spindle under an external controller: samples of x, y, z [m] and revolutions [1],
/// linear between the samples. Over a gap axes and spindle are at rest.
class AxesTrack {
 public:
  /// @param longest_step [s] between samples; longer intervals are gaps: two blocks of a servo stream
  explicit AxesTrack(double longest_step = 0.02) : longest_step_(longest_step) {}

  /// @throws Error naming a missing channel. Samples that are not newer than all earlier ones are ignored.
  void push(const SampleBlock& block);
  /// No samples until a time [s]: the axes are at rest from the last sample on and resume at the position of
  /// the next one.
  void holdUntil(double until);
  /// [s] time of the last sample; nullopt: none yet.
  std::optional<double> newest() const;
  /// @param time [s], not after newest(), not before that of an earlier call
  MotionState at(double time);

 private:
  struct Point {
    double time = 0.0;
    std::array<double, 3> position{};
    double revolutions = 0.0;
    int tool = 0;
    bool jump = false;  // no motion from the previous point to here
    bool held = false;  // added by holdUntil()
  };
  double longest_step_;
  std::deque<Point> points_;
};

}  // namespace smartmill::sim
