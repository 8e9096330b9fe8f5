#pragma once

#include <deque>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_sim/controller/path_move.h"

namespace smartmill::sim {

/// Motion of the axes along the path of a block, segment by segment. Times [s] are those of the caller's
/// clock and do not decrease.
class AxesMotion {
 public:
  using Point = PathMove::Point;
  struct Segment {
    PathMove move;
    bool rapid = false;
  };
  using Path = std::deque<Segment>;

  /// At rest at home.
  explicit AxesMotion(const MachineAxes& axes)
      : acceleration_(axes.acceleration), segment_{PathMove(axes.home)} {}

  Point position(double time) const { return segment_.move.position(time); }
  Point velocity(double time) const { return segment_.move.velocity(time); }
  double speed(double time) const { return segment_.move.speed(time); }  ///< [m/s] along the path
  Point target() const;                                                  ///< [m] end of the path
  Point distanceToGo(double time) const;                                 ///< [m]
  bool moving(double time) const { return time < segment_.move.end(); }
  /// Whether the axes come to rest within the segment, for lack of feed.
  bool held() const { return segment_.move.held(); }
  double end() const;  ///< [s] when the segment is complete; infinity: never with this feed

  /// The next path, from target() on.
  void setPath(Path path) { path_ = std::move(path); }
  bool hasNext() const { return !path_.empty(); }
  /// Makes the next segment the present one; it needs a feed.
  void beginNext();
  const Segment& segment() const { return segment_; }
  /// Feed [m/s] of the present segment from a time on; 0: the axes brake on the path.
  void setFeed(double time, double feed) { segment_.move.plan(time, feed, acceleration_); }
  /// Brakes on the path and drops the rest of it.
  void halt(double time);

 private:
  double acceleration_;  // [m/s2]
  Segment segment_;      // present or last one
  Path path_;            // further segments
};

}  // namespace smartmill::sim
