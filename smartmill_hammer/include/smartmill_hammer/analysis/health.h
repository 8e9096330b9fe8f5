#pragma once

#include <string>
#include <vector>

#include "smartmill_core/modal/results.h"

namespace smartmill::hammer {

constexpr double DAY = 86400.0;  ///< [s]

/// Normal relative changes from day to day (tool seat, temperature), one standard deviation, added to the
/// stated standard deviations.
struct HealthAllowance {
  double frequency = 0.002, damping = 0.05, gain = 0.03, friction = 0.05, unbalance = 0.1;
  double same_mode = 0.05;   ///< [1] of frequency, within which two modes are the same
  double least_gain = 0.05;  ///< [1] of the largest gain, from which a new or missing mode counts
};

/// [1] Standard deviations of a drift: by chance alone some dozens of quantities exceed it once in a thousand
/// comparisons.
constexpr double DRIFT_DEVIATIONS = 4.0;

/// A quantity at two times.
struct HealthChange {
  std::string quantity;            ///< e.g. "damping of the mode at 930 Hz"
  double before = 0.0, now = 0.0;  ///< [Hz], [1], [m/N] or friction's unit
  double relative = 0.0;           ///< [1] now / before - 1
  double sigmas = 0.0;             ///< standard deviations, of both values and the allowance
  bool drifted() const;            ///< beyond chance
};

/// Changes of the modes of one tool, point and direction. A mode that only one measurement contains is a
/// change of its own.
std::vector<HealthChange> modeChanges(const MeasuredModes& before, const MeasuredModes& now,
                                      const HealthAllowance& allowance = {});
/// A value with its standard deviation; 0: unknown.
struct ValueWithStd {
  double value = 0.0, std = 0.0;
};
HealthChange valueChange(const std::string& quantity, const ValueWithStd& before, const ValueWithStd& now,
                         double allowance);

/// The largest drift in one line; empty: none.
std::string driftText(const std::vector<HealthChange>& changes);

}  // namespace smartmill::hammer
