#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/cutting/stability_chart.h"
#include "smartmill_core/modal/results.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/chart/uncertainty.h"
#include "smartmill_stability/chart/what_if.h"
#include "smartmill_stability/solvers/solver.h"
#include "smartmill_stability/solvers/zero_order.h"

namespace smartmill::stability {

/// Parameters of a chart; units and ranges in declare().
struct ChartParameters {
  /// [1] Least ratio of depth to limit of a point proposed for a check, so that its outcome is unambiguous.
  static constexpr double CLEARLY_UNSTABLE = 1.5;

  double entry = 0.0, exit = units::PI;
  double feed_per_tooth = 1.0e-4;
  double radial_ratio = 0.3;
  double speed_low = 200.0, speed_high = 0.0;
  int speeds = 1500;
  double frequency_low = 50.0, frequency_high = 10000.0;
  double line_error = 0.05;
  std::string method = "zero_order";
  double modes_error = 0.1;
  bool use_modes = false;
  double max_depth = 0.02;
  double depth_margin = 0.2;
  double speed_margin = 0.01;
  double risk = 0.05;
  double frequency_std = 0.01, gain_std = 0.05, radial_std = 0.3;
  double load_share = 0.9;
  int recommended = 5;
  double unstable_factor = 1.75;
  int unstable = 5;

  void declare(ParameterTable& table);
  /// @throws Error naming key and value.
  void validate() const;
};

/// Whether a cut is stable.
struct Prediction {
  bool stable = false;
  bool within_spindle_limits = false;
  StabilityPoint point;
};

/// Computes charts from measurements: FRFs or modes of x and y, and coefficients, in any order.
class ChartMaker {
 public:
  /// @param model tool and spindle limits; its sections tool_tip and cutting are not used.
  /// @throws Error on bad parameters or a model without a tool.
  ChartMaker(const ChartParameters& parameters, const MachineModel& model);

  /// Points other than the tool tip are ignored; the first result of a new tool discards those of the old
  /// one.
  void handle(const MeasuredFrf& frf);
  void handle(const MeasuredModes& modes);
  void handle(const CoefficientSet& coefficients);

  /// List of the missing inputs; empty when a chart can be computed.
  std::string missing() const;

  /// @throws Error when an input is missing or inputs contradict each other.
  StabilityChart chart() const;

  /// The measured machine in a cut with another engagement (exit <= entry: the angles of the chart); empty
  /// while modes of x and y or the tangential coefficient are missing.
  std::optional<RegenerativeSystem> system(const Engagement& engagement) const;
  /// The same with the standard deviations of the measurements, combined with those of the parameters.
  std::optional<UncertainSystem> uncertainSystem(const Engagement& engagement) const;
  int teeth() const { return tool_geometry_.teeth; }
  std::size_t modesInX() const;                                   ///< first modes of system(); y follows
  double highestSpeed() const { return parameters_.speed_high; }  ///< [rad/s]

  /// @throws Error as chart(), and on a speed [rad/s] or depth [m] that is not positive.
  Prediction predict(double spindle_speed, double axial_depth) const;

  /// The chart of a modified cut, by collocation from the modes, fast enough for interactive use.
  /// @throws Error while modes of x and y or the tangential coefficient are missing, and on an invalid
  /// request.
  WhatIfChart whatIf(const WhatIf& request) const;

 private:
  struct Basis;
  Basis basis() const;
  void addSpread(const RegenerativeSystem& system, WhatIfChart& chart) const;
  bool byCollocation() const;
  bool needsModes() const;
  FrequencyResponse crossFrf() const;
  void use(const std::string& tool, double stamp);
  /// [m] Depths at which the rated torque and the rated power are reached at a speed.
  std::array<double, 2> loadLimits(double speed) const;
  /// [m] Largest depth permitted by torque, power and max_depth at speed k.
  double permittedDepth(const StabilityChart& chart, std::size_t k) const;
  int extraSpeeds() const;
  /// Extended beyond both ends of the chart by the speed margin.
  StabilityLimit wideLimits(const Basis& given) const;
  std::vector<double> depthShares(const std::vector<double>& speeds) const;
  void recommend(StabilityChart& chart, const StabilityLimit& wide) const;
  std::vector<StabilityPoint> confirmed(std::vector<StabilityPoint> peaks) const;
  void proposeUnstable(StabilityChart& chart, const StabilityLimit& wide) const;
  StabilityPoint point(double speed, double depth, double limit, double frequency) const;
  double torquePerDepth() const;  // [N]
  double friction(double speed) const;

  ChartParameters parameters_;
  ToolGeometry tool_geometry_;
  Spindle spindle_;
  std::map<std::string, MeasuredFrf> frfs_;
  std::map<std::string, MeasuredModes> modes_;
  std::optional<CoefficientSet> coefficients_;
  std::string tool_;
  double stamp_ = 0.0;
};

}  // namespace smartmill::stability
