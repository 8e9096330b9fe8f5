#include "smartmill_cnc/motion/progress_watch.h"

namespace smartmill::cnc {

void ProgressWatch::restart(double now) {
  progressed_ = now;
  still_since_.reset();
}

bool ProgressWatch::isStalled(const Reading& reading, double now, double timeout) {
  const CncState& state = reading.state;
  if (!reading.at_rest || state.run == CncRun::hold || state.sequence != last_.sequence ||
      state.spindle_speed != last_.spindle_speed || state.position != last_.position) {
    progressed_ = now;
  }
  last_ = state;
  return now - progressed_ > timeout;
}

bool ProgressWatch::isSettled(bool ended, double now, double settle_time) {
  if (!ended) {
    still_since_.reset();
    return false;
  }
  if (!still_since_) {
    still_since_ = now;
  }
  return now - *still_since_ >= settle_time;
}

bool ProgressWatch::restsAt(const Reading& reading) {
  const bool same = reading.state.position == last_.position;
  last_.position = reading.state.position;
  return reading.at_rest && same;
}

void ProgressWatch::shift(double jump) {
  progressed_ += jump;
  if (still_since_) {
    *still_since_ += jump;
  }
}

}  // namespace smartmill::cnc
