#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/modal/results.h"
#include "smartmill_hammer/analysis/health.h"
#include "smartmill_hammer/analysis/idle_spindle.h"

namespace smartmill {
namespace hammer {

/// A measurement against the first of its kind.
struct HealthReport {
  std::string measured;  ///< tool, point and direction; or the spindle in air with a tool
  double stamp = 0.0;    ///< [s]
  double days = 0.0;     ///< [day] since the first
  std::vector<HealthChange> changes;
};

/// What the node tells and warns of while it runs. It warns of each good measurement that differs from the
/// one before of the same tool, point and direction, and of cuts in air that differ from the first of the
/// same tool at the same speed, where the sensor's dynamics fall out. It tells measurements against the first
/// of their kind; cuts in air where a drift begins or ends, and else once an hour.
class HealthWatch {
 public:
  /// @return nothing: the first of its kind, or told already
  std::optional<HealthReport> measured(const MeasuredModes& modes);
  std::optional<HealthReport> turned(const std::string& tool, const IdleRecord& seen);

  /// One line each; empty: nothing has drifted.
  std::vector<std::string> warnings() const;

 private:
  struct Modes {
    MeasuredModes first, last;
    std::string drift;  // of the last; empty: none
  };
  struct Air {
    IdleRecord first;
    double since = 0.0;  // [s] end of the first
    std::string drift;
    std::optional<double> told;  // [s]
  };
  std::map<std::string, Modes> modes_;  // by tool, point and direction
  std::map<std::string, Air> air_;      // by tool
};

}  // namespace hammer
}  // namespace smartmill
