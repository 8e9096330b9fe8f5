#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "smartmill_cnc/controller/controller.h"

namespace smartmill::cnc {

/// The last reading of the controller.
struct Observation {
  std::optional<Reading> reading;  ///< empty before the first and after a loss
  double now = 0.0;                ///< [s] its stamp

  const CncState& state() const { return reading->state; }
  /// [s] Jump of the clock to the next stamp: it was set, or the computer was suspended; 0: none.
  /// @param longest_step [s] between two stamps
  double clockJump(double next, double longest_step) const;
  /// Index of x (0), y (1), z (2) among the controller's axes.
  std::optional<std::size_t> axisIndex(int axis) const;

  std::string alarmText() const;
  std::string modeText() const;
  std::string textOf(const Failure& failure) const;
};

}  // namespace smartmill::cnc
