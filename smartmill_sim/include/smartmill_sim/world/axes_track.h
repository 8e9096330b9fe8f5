#pragma once

#include <array>
#include <deque>
#include <optional>

#include "smartmill_core/signal/streams.h"
#include "smartmill_sim/controller/controller.h"

namespace smartmill::sim {

/// Where a controller elsewhere leads axes and spindle: samples of x, y, z [m] and revolutions [1] with their
/// times, straight lines between them. Over a gap everything stands.
class AxesTrack {
 public:
  /// @throws Error naming a channel that is missing. What is not newer than all before is left out.
  void push(const SampleBlock& block);
  /// Nothing has come until a time [s]: the axes stand since the last sample, and go on from where the next
  /// one is.
  void stand(double until);
  /// [s] of the last sample; nothing before the first.
  std::optional<double> newest() const;
  /// @param time [s], not after newest(), not before one asked for earlier
  MotionState at(double time);

 private:
  struct Point {
    double time = 0.0;
    std::array<double, 3> position{};
    double revolutions = 0.0;
    bool jump = false;    // no way leads here from the point before
    bool stands = false;  // made by stand()
  };
  std::deque<Point> points_;
};

}  // namespace smartmill::sim
