#pragma once

#include <string>
#include <vector>

#include "smartmill_core/modal/results.h"

namespace smartmill {
namespace hammer {

/// What changes from day to day without anything being wrong (seat, temperature), one standard deviation,
/// relative; added to the stated deviations.
struct HealthAllowance {
  double frequency = 0.002, damping = 0.05, gain = 0.03, friction = 0.05, unbalance = 0.1;
};

/// A quantity at two times.
struct HealthChange {
  std::string what;                ///< e.g. "damping of the mode at 930 Hz"
  double before = 0.0, now = 0.0;  ///< [Hz], [1], [m/N] or friction's unit
  double relative = 0.0;           ///< [1] now / before - 1
  double sigmas = 0.0;             ///< of both deviations and the allowance
  bool drifted() const;            ///< more than chance gives
};

/// Modes of one tool, point and direction measured twice; a mode that only one of them shows is a change of
/// its own.
std::vector<HealthChange> modeChanges(const MeasuredModes& before, const MeasuredModes& now,
                                      const HealthAllowance& allowance = {});
/// A value with its standard deviation; 0: none is stated.
struct Stated {
  double value = 0.0, std = 0.0;
};
HealthChange valueChange(const std::string& what, const Stated& before, const Stated& now, double allowance);

/// One line naming what has drifted most; empty: nothing.
std::string driftOf(const std::vector<HealthChange>& changes);

}  // namespace hammer
}  // namespace smartmill
