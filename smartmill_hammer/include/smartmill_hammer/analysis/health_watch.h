#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/modal/results.h"
#include "smartmill_hammer/analysis/health.h"
#include "smartmill_hammer/analysis/idle_spindle.h"

namespace smartmill::hammer {

/// A measurement compared with the first of its kind.
struct HealthReport {
  std::string measured;  ///< tool, point and direction; or the spindle in air with a tool
  double stamp = 0.0;    ///< [s]
  double days = 0.0;     ///< [day] since the first
  std::vector<HealthChange> changes;
};

/// Reports and warnings of the node while it runs. It warns when a measurement differs from the previous one
/// of the same tool, point and direction, and when an air cut differs from the first one of the same tool at
/// the same speed, where the sensor's dynamics cancel. It reports each measurement against the first of its
/// kind; air cuts where a drift begins or ends, and otherwise once an hour.
class HealthWatch {
 public:
  /// @param report_period [s] between two reports of air cuts without a change: a warm-up takes hours
  explicit HealthWatch(double report_period = 3600.0) : report_period_(report_period) {}

  /// @return empty: the first of its kind, or already reported
  std::optional<HealthReport> addModes(const MeasuredModes& modes);
  std::optional<HealthReport> addAirCut(const std::string& tool, const AirCutRecord& record);

  /// One line per drift.
  std::vector<std::string> warnings() const;

 private:
  struct Modes {
    MeasuredModes first, last;
    std::string drift;  // of the last one; empty: none
  };
  struct AirCut {
    AirCutRecord first;
    double first_end = 0.0;  // [s]
    std::string drift;
    std::optional<double> last_report;  // [s]
  };
  double report_period_;
  std::map<std::string, Modes> modes_;      // by tool, point and direction
  std::map<std::string, AirCut> air_cuts_;  // by tool
};

}  // namespace smartmill::hammer
