#pragma once

#include <cmath>
#include <vector>

#include "smartmill_stability_testing/turning_process.h"

namespace smartmill::stability {

constexpr double SEGMENT = 2.048;         // [s]
constexpr double CONTROL_RATE = 10000.0;  // [Hz]

/// Kim's case (K/K_m 0.1, zeta 0.02, 350 rad/s) at the period near 0.109 s for which the uncontrolled
/// vibration grows by exp(logarithm) per segment; the paper does not state the period.
inline TurningProcess kimProcess(double logarithm) {
  TurningProcess process;
  double low = 0.108, high = 0.111;  // growth per segment from below e^0.2 to above e^5
  for (int i = 0; i < 50; ++i) {
    process.period = 0.5 * (low + high);
    (growthRate(process) * SEGMENT < logarithm ? low : high) = process.period;
  }
  return process;
}

inline ControllerParameters kimController(const TurningProcess& process) {
  ControllerParameters parameters;
  parameters.rate = CONTROL_RATE;
  parameters.period = process.period;
  parameters.chip = process.chip;
  parameters.leaves_cut = false;  // the process is linear
  return parameters;
}

/// [m] RMS of the motion about its mean, from begin to end [s].
inline double vibration(const TurningRun& run, double begin, double end) {
  double sum = 0.0, squares = 0.0, n = 0.0;
  for (std::size_t i = 0; i < run.time.size(); ++i) {
    if (run.time[i] < begin || run.time[i] >= end) continue;
    sum += run.motion[i];
    squares += run.motion[i] * run.motion[i];
    n += 1.0;
  }
  return std::sqrt(std::max(0.0, squares / n - sum * sum / n / n));
}

}  // namespace smartmill::stability
