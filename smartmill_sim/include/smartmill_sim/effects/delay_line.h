#pragma once

#include <cstddef>
#include <vector>

namespace smartmill::sim {

/// A signal that comes late by a constant time, linear between steps.
class DelayLine {
 public:
  /// @param delay [s] >= 0 @param time_step [s] > 0 @param rest shown until the signal's start arrives
  DelayLine(double delay, double time_step, double rest);

  double step(double value);

  /// As if value had stood since ever.
  void reset(double value);

 private:
  std::vector<double> past_;  // ring
  std::size_t next_ = 0;
  double share_;  // of the older of two neighbours
};

}  // namespace smartmill::sim
