#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/modal/results.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/solvers/solver.h"
#include "smartmill_stability/solvers/zero_order.h"

namespace smartmill::stability {

/// What a chart is asked for.
struct ChartParameters {
  double entry = 0.0;               ///< [rad] 0..2 pi
  double exit = units::PI;          ///< [rad] > entry
  double feed_per_tooth = 0.1e-3;   ///< [m] > 0, to which torque, power and removal rate belong
  double kr = 0.3;                  ///< [1] >= 0, radial over tangential where Krc was not identified
  double speed_low = 200.0;         ///< [rad/s] > 0
  double speed_high = 0.0;          ///< [rad/s] > speed_low; 0: the spindle's highest speed
  int speeds = 1500;                ///< [1] 2..100000
  double frequency_low = 50.0;      ///< [Hz] >= 0, lines of measured FRFs below say little and are left out
  double frequency_high = 10000.0;  ///< [Hz] > frequency_low
  double line_error = 0.05;  ///< [1] > 0, lines with a standard deviation above this share of the FRF's peak
                             ///< are left out: the hammer's spectrum has zeros
  /// auto: collocation where modes of x and y are known and fit well, else zero_order; collocation;
  /// zero_order.
  std::string method = "auto";
  double modes_error = 0.1;       ///< [1] > 0, relative error of the fit up to which auto trusts the modes
  bool use_modes = false;         ///< zero_order from fitted modes instead of the measured FRFs
  double max_depth = 0.02;        ///< [m] > 0, no deeper cut is recommended or proposed
  double depth_margin = 0.2;      ///< [1] 0 <= value < 1, recommended depths stay this share below the limit
  double speed_margin = 0.01;     ///< [1] 0 <= value < 0.2, and below it for speeds this much off
  double load_share = 0.9;        ///< [1] 0 < value <= 1, of the spindle's torque and power that is used
  int recommended = 5;            ///< [1] 0..100 points
  double unstable_factor = 1.75;  ///< [1] 1.5..5, depth of the points for a check over the limit
  int unstable = 5;               ///< [1] 0..100 points

  /// @throws Error naming key and value.
  void validate() const;
};

/// One point of a chart.
struct ChartPoint {
  double spindle_speed = 0.0;                                           ///< [rad/s]
  double axial_depth = 0.0;                                             ///< [m]
  double depth_limit = 0.0;                                             ///< [m] +inf: none
  double chatter_frequency = std::numeric_limits<double>::quiet_NaN();  ///< [Hz] at the limit
  double torque = 0.0;                 ///< [N m] mean cutting torque at the chart's feed per tooth
  double power = 0.0;                  ///< [W] mean cutting power
  double material_removal_rate = 0.0;  ///< [m3/s]
};

struct Chart {
  double stamp = 0.0;  ///< [s] of the newest input
  std::string tool, material;
  std::string method;  ///< zero_order or collocation
  StabilityLimit limit;
  std::vector<double>
      torque_depth_limit;                 ///< [m] +inf: no limit known; friction takes its part of the torque
  std::vector<double> power_depth_limit;  ///< [m]
  double absolute_depth_limit = 0.0;      ///< [m] stable at any speed (collocation: of the chart)
  std::vector<ChartPoint> recommended;    ///< best removal rate first, one a pocket
  std::vector<ChartPoint> unstable;       ///< in the valleys, nearest to the best recommended speed first
};

/// Answer to: is this cut stable?
struct Prediction {
  bool stable = false;
  bool within_spindle_limits = false;
  ChartPoint point;
};

/// Makes charts of what was measured: gathers the FRFs (or modes) of x and y and the coefficients, in any
/// order.
class ChartMaker {
 public:
  /// @param model tool and spindle limits; neither its tool_tip nor its cutting section is read.
  /// @throws Error on bad parameters or a model without a tool.
  ChartMaker(const ChartParameters& parameters, const MachineModel& model);

  /// Other points than the tool tip are left alone; a new tool's FRF puts those of the old tool away.
  void handle(const MeasuredFrf& frf);
  void handle(const MeasuredModes& modes);
  void handle(const CoefficientSet& coefficients);

  /// What is still missing, empty when a chart can be made.
  std::string missing() const;

  /// @throws Error when something is missing or the data contradict each other.
  Chart chart() const;

  /// The machine as measured in a cut with other angles (a cut that has none: those of the chart); empty
  /// while modes of x and y or the tangential coefficient are missing.
  std::optional<RegenerativeSystem> system(const Engagement& engagement) const;
  int teeth() const { return tool_geometry_.teeth; }
  std::size_t modesInX() const;                                   ///< of system(): those of y follow
  double highestSpeed() const { return parameters_.speed_high; }  ///< [rad/s]

  /// @throws Error as chart(), or on a speed or depth that is not positive.
  Prediction predict(double spindle_speed, double axial_depth) const;

 private:
  struct Basis;
  Basis basis() const;
  bool byCollocation() const;
  bool needsModes() const;
  void use(const std::string& tool, double stamp);
  /// Depth that the spindle carries at a speed: torque and power limit [m].
  std::array<double, 2> loadLimits(double speed) const;
  double carried(const Chart& chart, std::size_t k) const;  // [m] by the spindle at a speed, with its reserve
  int linesBeyond() const;
  /// A little beyond both ends of the chart, so that the margin of speed holds there too.
  StabilityLimit wideLimits(const Basis& given) const;
  void recommend(Chart& chart, const StabilityLimit& wide) const;
  void proposeUnstable(Chart& chart, const StabilityLimit& wide) const;
  ChartPoint point(double speed, double depth, double limit, double frequency) const;
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
