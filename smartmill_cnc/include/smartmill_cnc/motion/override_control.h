#pragma once

#include <optional>
#include <string>

#include "smartmill_cnc/log.h"
#include "smartmill_cnc/motion/motion_limits.h"
#include "smartmill_cnc/motion/observation.h"
#include "smartmill_cnc/motion/outcome.h"

namespace smartmill::cnc {

/// The overrides of the running program, within their limits.
class OverrideControl {
 public:
  /// The arguments must outlive it.
  OverrideControl(Controller& controller, const MotionLimits& limits, const Observation& observation,
                  Log& log);

  /// @param programmed [rad/s] spindle speed of the program; nullopt: unknown. @param reason for the log
  /// @return a failure only if it lost the connection.
  Result<OverrideAnswer> set(const Overrides& wanted, std::optional<double> programmed,
                             const std::string& reason);
  /// Back to 1. @return a failure only if it lost the connection.
  Status reset();
  /// An earlier client may have left overrides, which the next reset() removes.
  void assumeChanged() { changed_ = controller_.takesOverrides(); }

 private:
  std::string fault(const Overrides& wanted, std::optional<double> programmed) const;

  Controller& controller_;
  const MotionLimits& limits_;
  const Observation& observation_;
  Log& log_;
  bool changed_ = false;  // those of the controller may differ from 1
  Overrides accepted_;    // last
};

}  // namespace smartmill::cnc
