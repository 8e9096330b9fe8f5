#pragma once

#include <deque>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "smartmill_loadmeter/calibration/machine_calibration.h"
#include "smartmill_loadmeter/database/database.h"
#include "smartmill_loadmeter/identification/cut_forces.h"
#include "smartmill_loadmeter/identification/load_test.h"
#include "smartmill_loadmeter/identification/production.h"
#include "smartmill_loadmeter/motor/joint.h"

namespace smartmill::loadmeter {

/// Running estimate over the cuts of each tool and material, and the record of each cut for the database.
class ProductionRun {
 public:
  /// @param memory [s], see RecursiveCoefficients.
  explicit ProductionRun(double memory) : memory_(memory) {}

  /// @param torque [N m] of the cut, with the friction of the air cuts subtracted. @param own_std [N m] part
  /// of its standard deviation that is not of the friction. @param force of the cut, from which the radial
  /// and axial coefficients follow together with the cuts before. @return condition, age of the edge and the
  /// running estimate; empty without a torque, and while the estimate of Ktc is not positive. The standard
  /// deviations are those of one of the n cuts in the estimate, so that the combined records of a sequence of
  /// cuts are as certain as the estimate.
  std::optional<CoefficientRecord> add(const LoadTest& cut, const std::optional<Estimate>& torque,
                                       double own_std, const MeanForce& force = {});

  /// Of the tool and material of the last cut; empty before a cut with known friction.
  const std::optional<RecursiveCoefficients>& estimate() const { return estimates_.at(of_); }
  const std::string& tool() const { return of_.first; }  ///< of the last cut
  /// [s] cutting time of a tool's edge since the start of the node; NaN: no cut with it.
  double edgeAge(const std::string& tool) const {
    const auto found = edge_age_.find(tool);
    return found == edge_age_.end() ? CoefficientRecord::UNKNOWN : found->second;
  }
  void clear() { *this = ProductionRun(memory_, std::move(edge_age_)); }  ///< the ages of the edges remain

 private:
  using Pair = std::pair<std::string, std::string>;  // tool, material
  ProductionRun(double memory, std::map<std::string, double> edge_age)
      : memory_(memory), edge_age_(std::move(edge_age)) {}

  /// Cuts with a measured force, latest last.
  struct ForceCut {
    JointMeasurement measured;
    double time = 0.0;  // [s] of cutting
  };
  void addForces(const LoadTest& cut, const Estimate& torque, const MeanForce& force,
                 CoefficientRecord* record);

  double memory_;
  Pair of_;  // of the last cut
  std::map<Pair, std::optional<RecursiveCoefficients>> estimates_{{of_, std::nullopt}};
  std::map<Pair, std::deque<ForceCut>> force_cuts_;
  std::map<std::string, double> edge_age_;  // [s] cutting time by tool
};

}  // namespace smartmill::loadmeter
