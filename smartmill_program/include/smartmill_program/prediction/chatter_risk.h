#pragma once

#include <map>
#include <memory>
#include <optional>
#include <tuple>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_program/prediction/engagement_cell.h"
#include "smartmill_stability/chart/risk.h"

namespace smartmill::program {

/// Probability that a cut chatters: the fraction of machines drawn from the standard deviations of a model's
/// modes and coefficients that chatter at a speed or at either end of its margin, by collocation.
class ChatterRisk {
 public:
  /// @param options of the draws; largest probability that is computed
  explicit ChatterRisk(const MachineModel& model, const stability::RiskOptions& options);
  ~ChatterRisk();

  /// Whether the model of the mean values is stable. @param speed [rad/s] > 0 @param depth [m]
  bool meanIsStable(const EngagementCell& cell, double speed, double depth);
  /// [1] empty: more than the risk of the options
  std::optional<double> probability(const EngagementCell& cell, double speed, double depth);
  /// [1] The same, once for depths that differ by less than 2 %.
  std::optional<double> rounded(const EngagementCell& cell, double speed, double depth);

 private:
  struct Drawn;
  Drawn& drawn(const EngagementCell& cell);

  const MachineModel& model_;
  stability::RiskOptions options_;
  std::map<EngagementCell, std::unique_ptr<Drawn>> drawn_;
  std::map<std::tuple<EngagementCell, int, int>, std::optional<double>> known_;  // speed [rpm], depth [2 %]
};

}  // namespace smartmill::program
