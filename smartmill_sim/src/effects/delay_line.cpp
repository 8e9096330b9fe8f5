#include "smartmill_sim/effects/delay_line.h"

#include <algorithm>
#include <cmath>

namespace smartmill::sim {

DelayLine::DelayLine(double delay, double time_step, double rest) {
  const double steps = delay / time_step, whole_steps = std::floor(steps);
  past_.assign(static_cast<std::size_t>(whole_steps) + 2, rest);
  share_ = steps - whole_steps;
}

double DelayLine::step(double value) {
  // The ring contains the values of the last whole_steps + 2 steps; the oldest follows this one.
  past_[next_] = value;
  next_ = next_ + 1 < past_.size() ? next_ + 1 : 0;
  const double older = past_[next_], newer = past_[next_ + 1 < past_.size() ? next_ + 1 : 0];
  return newer + share_ * (older - newer);
}

void DelayLine::reset(double value) {
  std::fill(past_.begin(), past_.end(), value);
}

}  // namespace smartmill::sim
