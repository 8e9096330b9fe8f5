#pragma once

#include <cstddef>
#include <vector>

namespace smartmill::sim {

/// Delays a signal by a constant time; linear between steps.
class DelayLine {
 public:
  /// @param delay [s] >= 0 @param time_step [s] > 0 @param rest output until the start of the signal arrives
  DelayLine(double delay, double time_step, double rest);

  double step(double value);

  /// Sets the past of the signal to a constant value.
  void reset(double value);

 private:
  std::vector<double> past_;  // ring
  std::size_t next_ = 0;
  double share_;  // weight of the older of two neighbours
};

}  // namespace smartmill::sim
