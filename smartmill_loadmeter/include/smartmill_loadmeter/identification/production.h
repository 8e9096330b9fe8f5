#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::loadmeter {

/// Mean torque of one cut.
struct TorqueMeasurement {
  ToolGeometry tool;
  Engagement engagement;
  double torque = 0.0;        ///< [N m] mean cutting torque
  double torque_std = 0.0;    ///< [N m] > 0, independent of other measurements
  double cutting_time = 0.0;  ///< [s] of the edge since the previous measurement
  double common_std = 0.0;  ///< [N m] part of the error that all measurements share: friction of the spindle
};

/// Running estimate of Ktc and Kte over production cuts: recursive least squares of the mean torque (eq. 3.19
/// for any engagement) with exponential forgetting in cutting time, so that it follows wear. Directions
/// without excitation (one feed only) return to the initial uncertainty, not beyond. The standard deviations
/// allow for a drift within the memory; for constant coefficients they are up to sqrt(2) times the errors. A
/// common error of the torques moves the estimate, and is not reduced by more cuts. Torques that contradict
/// each other by more than their standard deviations (misfit()) increase those of the coefficients.
class RecursiveCoefficients {
 public:
  struct Start {
    double ktc = 1e9, kte = 1.5e4;        ///< [N/m2], [N/m]
    double ktc_std = 1e9, kte_std = 5e4;  ///< > 0
  };
  /// @param memory [s] > 0 cutting time after which the weight of a measurement is 1/e.
  /// @throws Error when a value is out of range.
  RecursiveCoefficients(const Start& start, double memory);

  void update(const TorqueMeasurement& reading);

  double ktc() const { return value_[0]; }
  double kte() const { return value_[1]; }
  double ktcStd() const;
  double kteStd() const;
  double covariance() const;  ///< of the two
  /// Normalised innovation of the last measurement: beyond 3 the cut contradicts the estimate.
  double normalisedInnovation() const { return innovation_; }
  /// [1] RMS of the normalised innovations, and 1 where 99 % of sets without contradiction scatter as much:
  /// the factor of the independent part of the standard deviations (Birge ratio).
  double misfit() const;
  int readings() const { return readings_; }

 private:
  std::array<double, 2> common() const;
  std::array<double, 2> independent() const;

  std::array<double, 2> value_;
  std::array<double, 3> information_{}, start_{};  // xx, xy, yy
  std::array<double, 2> pull_{};                   // information times the shift by one common deviation
  double memory_;
  double innovation_ = 0.0;
  double squares_ = 0.0, weight_ = 0.0;  // [1] of the innovations and their number, with forgetting
  int readings_ = 0;
};

/// Limits of a test cut.
struct CutLimits {
  double torque = 0.0;  ///< [N m] mean
  double power = 0.0;   ///< [W]
  /// Largest stable axial depth [m] at a spindle speed [rad/s] for an engagement; empty: unlimited.
  std::function<double(double speed, const Engagement& engagement)> stable_depth;
};

/// Candidate cuts of a plan.
struct CandidateCuts {
  std::vector<double> speeds;                         ///< [rad/s]
  std::vector<double> feeds;                          ///< [m] per tooth
  std::vector<double> axial_depths;                   ///< [m]
  double entry = 0.0, exit = 3.14159265358979323846;  ///< [rad]
};

struct PlannedCut {
  double speed = 0.0;  ///< [rad/s]
  Engagement engagement;
  double torque = 0.0, power = 0.0;  ///< [N m], [W] expected
};

struct TestPlan {
  std::vector<PlannedCut> cuts;
  double ktc_std = 0.0, kte_std = 0.0;  ///< expected
};

/// Fewest cuts that reach the target standard deviations, with at least three different feeds (regression),
/// selected one by one and improved by exchanges.
/// @param expected coefficients Ktc, Kte.
/// @param voltage_std [V] of one cut's mean load-meter voltage.
/// @param max_cuts largest number of cuts.
/// @throws Error when fewer than three feeds satisfy the limits, or max_cuts do not reach the targets.
TestPlan planTests(const ToolGeometry& tool, const Spindle& spindle, const CuttingCoefficients& expected,
                   const CandidateCuts& candidates, const CutLimits& limits, double voltage_std,
                   double target_ktc_std, double target_kte_std, std::size_t max_cuts);

}  // namespace smartmill::loadmeter
