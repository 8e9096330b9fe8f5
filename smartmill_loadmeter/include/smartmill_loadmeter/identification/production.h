#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::loadmeter {

/// Mean torque of one cut of whatever kind.
struct TorqueReading {
  ToolGeometry tool;
  Engagement engagement;
  double torque = 0.0;        ///< [N m] mean cutting torque
  double torque_std = 0.0;    ///< [N m] > 0
  double cutting_time = 0.0;  ///< [s] of the edge since the last reading
};

/// Ktc and Kte followed over ordinary production cuts: recursive least squares on the mean torque (eq. 3.19
/// for any engagement), forgetting what is older than some minutes of cutting, so that wear shows. Directions
/// that the cuts do not excite (one feed only) fade back to the uncertainty of the start, never beyond.
/// Standard deviations leave room for a drift within the memory: of coefficients that stand still they are up
/// to sqrt(2) times as large as the errors.
class RecursiveCoefficients {
 public:
  struct Start {
    double ktc = 1e9, kte = 1.5e4;        ///< [N/m2], [N/m]
    double ktc_std = 1e9, kte_std = 5e4;  ///< > 0
  };
  /// @param memory [s] > 0 of cutting time after which a reading counts 1/e.
  /// @throws Error naming a value out of range.
  RecursiveCoefficients(const Start& start, double memory);

  void update(const TorqueReading& reading);

  double ktc() const { return value_[0]; }
  double kte() const { return value_[1]; }
  double ktcStd() const;
  double kteStd() const;
  double covariance() const;  ///< of the two
  /// Normalised innovation of the last reading, z-score: beyond 3 the cut was not what was believed.
  double surprise() const { return surprise_; }
  int readings() const { return readings_; }

 private:
  std::array<double, 2> value_;
  std::array<double, 3> information_{}, start_{};  // xx, xy, yy
  double memory_;
  double surprise_ = 0.0;
  int readings_ = 0;
};

/// What a test cut may not exceed.
struct CutLimits {
  double torque = 0.0;  ///< [N m] mean
  double power = 0.0;   ///< [W]
  /// Largest stable axial depth [m] at a spindle speed [rad/s] for an engagement; empty: no limit known.
  std::function<double(double speed, const Engagement& engagement)> stable_depth;
};

/// Cuts the planner may choose among.
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

/// Fewest cuts that reach the asked standard deviations: at least three different feeds (regression), chosen
/// one by one and then exchanged while that helps. @param believed expected coefficients (Ktc, Kte). @param
/// voltage_std [V] of one cut's mean load-meter voltage. @param most cuts allowed.
/// @throws Error when no candidate keeps the limits, or `most` cuts do not reach what is asked.
TestPlan planTests(const ToolGeometry& tool, const Spindle& spindle, const CuttingCoefficients& believed,
                   const CandidateCuts& candidates, const CutLimits& limits, double voltage_std,
                   double asked_ktc_std, double asked_kte_std, std::size_t most);

}  // namespace smartmill::loadmeter
