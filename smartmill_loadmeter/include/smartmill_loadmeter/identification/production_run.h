#pragma once

#include <map>
#include <optional>
#include <string>

#include "smartmill_loadmeter/calibration/machine_calibration.h"
#include "smartmill_loadmeter/database/database.h"
#include "smartmill_loadmeter/identification/load_test.h"
#include "smartmill_loadmeter/identification/production.h"

namespace smartmill::loadmeter {

/// Running estimate over the cuts of one tool and material, and the record of each cut for the database.
class ProductionRun {
 public:
  /// @param memory [s], see RecursiveCoefficients.
  explicit ProductionRun(double memory) : memory_(memory) {}

  /// @param torque [N m] of the cut, with the friction of the air cuts subtracted. @param own_std [N m] part
  /// of its standard deviation that is not of the friction. @return condition, age of the edge and the
  /// running estimate; empty without a torque. The standard deviations are those of one of the n cuts in the
  /// estimate, so that the combined records of a sequence of cuts are as certain as the estimate.
  std::optional<CoefficientRecord> add(const LoadTest& cut, const std::optional<Estimate>& torque,
                                       double own_std);

  /// Since the last change of tool or material; empty before a cut with known friction.
  const std::optional<RecursiveCoefficients>& estimate() const { return estimate_; }
  /// [s] cutting time of a tool's edge since the start of the node; NaN: no cut with it.
  double edgeAge(const std::string& tool) const {
    const auto found = edge_age_.find(tool);
    return found == edge_age_.end() ? CoefficientRecord::UNKNOWN : found->second;
  }
  void clear() { estimate_.reset(); }  ///< the ages of the edges remain

 private:
  double memory_;
  std::optional<RecursiveCoefficients> estimate_;
  std::string of_;                          // tool and material
  std::map<std::string, double> edge_age_;  // [s] cutting time by tool
};

}  // namespace smartmill::loadmeter
