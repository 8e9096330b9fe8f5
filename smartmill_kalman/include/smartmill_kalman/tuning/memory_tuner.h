#pragma once

#include <array>
#include <vector>

#include "smartmill_kalman/compensation/compensation_method.h"
#include "smartmill_kalman/filter/harmonic_filter.h"
#include "smartmill_kalman/tuning/memory_schedule.h"

namespace smartmill::kalman {

/// Samples of the force sensor at one spindle speed: in air, and in a cut from before tool entry on.
struct TuningRecord {
  double speed = 0.0;                               ///< [rad/s]
  double sample_rate = 0.0;                         ///< [Hz]
  std::array<std::vector<double>, 3> air{}, cut{};  ///< [N]
};

struct TuningOptions {
  /// [revolutions] powers of two, as Burzoni's q = 2^n; beyond 32 a cut of a second is too short.
  std::vector<double> memories{0.2, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0};
  /// [revolutions] memory of the smoother that gives the force of the reproduced cut. 0.2 to 2 select the
  /// same memory within one step; shorter ones take noise for force.
  double reference_memory = 1.0;
  /// [1] lag-one correlation of the fixed design's innovations above which the force model misses harmonics
  /// or modes (the limit of the diagnostics): errors cannot be predicted, the fixed design stays.
  double max_correlation = 0.5;
  /// [1] least predicted reduction of the error: predicted and true reductions differ by this much on the
  /// simulated machine (seeds 41, 2028), so that a smaller one may be none.
  double least_gain = 0.1;
  /// [1] of the steady force: a larger change between the revolutions before and after one is tool entry,
  /// where the smoothed force counts, with its noise.
  double changing = 0.1;
  double settled = 0.02;  ///< [s] start of a record that whiteness does not use
};

/// Process noise that minimises the force error at one speed. The cut is reproduced: the force that a
/// smoother finds in it, in the steady part without its noise, passes the identified sensor, and the samples
/// measured in air are its noise. Each
/// candidate q = r dt / tau^2 (Burzoni eq. 6-2) filters the reproduced cut, whose force is known (his taps
/// have a known force too; an impact is not periodic, so that it cannot tune a filter of harmonics). The
/// criterion is the RMS of the force error from before tool entry on: noise of a short memory, delay of a
/// long one. @throws Error naming the axis and what is missing
std::array<TunedMemory, 3> tuneMemory(const TuningRecord& record, const std::array<SensorAxis, 3>& sensor,
                                      const HarmonicFilterParameters& parameters,
                                      const TuningOptions& options = {});

}  // namespace smartmill::kalman
