#include "controller/axes_motion.h"

#include <limits>

namespace smartmill::sim {

AxesMotion::Point AxesMotion::target() const {
  return path_.empty() ? segment_.move.target() : path_.back().move.target();
}

AxesMotion::Point AxesMotion::distanceToGo(double time) const {
  Point remaining = target();
  const Point at = position(time);
  for (std::size_t i = 0; i < 3; ++i) remaining[i] -= at[i];
  return remaining;
}

double AxesMotion::end() const {
  return held() ? std::numeric_limits<double>::infinity() : segment_.move.end();
}

void AxesMotion::beginNext() {
  segment_ = path_.front();
  path_.pop_front();
}

void AxesMotion::halt(double time) {
  if (moving(time)) {
    segment_.move.stop(time, acceleration_);
  } else if (held()) {
    segment_.move = PathMove(position(time));  // at rest in feed hold: the rest of its path is dropped
  }
  path_.clear();
}

}  // namespace smartmill::sim
