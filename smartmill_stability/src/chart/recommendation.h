#pragma once

#include <optional>
#include <vector>

#include "chart/size_limit.h"
#include "chart/spindle_load.h"
#include "smartmill_core/cutting/stability_chart.h"
#include "smartmill_stability/chart/measured_machine.h"

namespace smartmill::stability {

/// Choice among the cuts of a chart.
struct RecommendationOptions {
  /// [1] Points with a smaller relative difference of speed belong to one pocket or valley; neighbouring
  /// lobes of the tenth order are still 10 % apart.
  double same_pocket = 0.03;
  int extra_speeds = 20;  ///< at each end of the chart, which resolve the speed margin beyond it
  /// [1] Cuts that remove at least this share of the most are equal; the one with the widest margin is taken.
  double as_much = 0.98;
  int draws = 100;           ///< machines for the depth at a risk: 5 % is the fifth of them
  unsigned seed = 1;         ///< a chart depends on its inputs only
  double reduction = 0.95;   ///< [1] of the depth, each time collocation rejects a cut
  double least_depth = 0.2;  ///< [1] of the first depth, below which a rejected cut is dropped
};
inline constexpr RecommendationOptions RECOMMENDATION;

/// Cuts that a chart recommends, and unstable ones for a check.
class Recommendation {
 public:
  /// @param wide limits, extended beyond both ends of the chart by the speed margin
  Recommendation(const ChartCut& cut, const MeasuredMachine& machine, const StabilityLimit& wide)
      : cut_(cut),
        parameters_(cut.parameters),
        machine_(machine),
        load_(cut, machine.coefficients()),
        wide_(wide) {}

  /// Speeds of a chart, extended as `wide`. [rad/s]
  static std::vector<double> wideSpeeds(const ChartParameters& parameters);
  /// Additional speeds at each end of the wide limits.
  static int extraSpeeds(const ChartParameters& parameters);

  /// Sets recommended and unstable points of a chart with limits.
  void addTo(StabilityChart& chart) const;

 private:
  void recommend(StabilityChart& chart) const;
  void proposeUnstable(StabilityChart& chart) const;
  std::vector<StabilityPoint> confirmed(std::vector<StabilityPoint> peaks, const SizeLimit* size) const;
  std::optional<SizeLimit> sizeLimit() const;
  RiskOptions riskOptions() const;
  std::vector<double> depthShares(const std::vector<double>& speeds) const;
  /// [m] Largest depth permitted by torque, power and max_depth at speed k.
  double permittedDepth(const StabilityChart& chart, std::size_t k) const;

  const ChartCut& cut_;
  const ChartParameters& parameters_;
  const MeasuredMachine& machine_;
  SpindleLoad load_;
  const StabilityLimit& wide_;
};

}  // namespace smartmill::stability
