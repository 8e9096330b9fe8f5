#pragma once

#include <array>
#include <functional>
#include <optional>
#include <vector>

#include "smartmill_loadmeter/identification/identification.h"
#include "smartmill_loadmeter/motor/motor_calibration.h"

namespace smartmill::loadmeter {

/// One day of a simulated machine with Hall sensors at its motors (smartmill_sim/world/motor_currents.h):
/// slots in metals of several kinds along X, Y and both, each with an air pass before it.
struct MotorDay {
  double temperature = 20.0;  ///< [deg C]
  unsigned seed = 1;
  int cuts = 24;
  double duration = 1.4;      ///< [s] of each pass
  bool diagonal = true;       ///< also slots along both axes, where the cutting force may act along the feed
  bool force_sensor = false;  ///< the dynamometer of the twin provides force/compensated
  bool rapid_moves = true;    ///< each group of cuts begins with rapid moves, which identify the lags
  bool servo = false;         ///< record of Servo Guide instead of the Hall sensors
  bool learn = false;         ///< no calibration given: it is made from the cuts of the session
};

/// A slot: truth of the twin and result of the estimator.
struct MotorCut {
  double speed_rpm = 0.0, feed_per_tooth = 0.0, depth = 0.0;  ///< [rpm], [m], [m]
  double radius = 0.0;                                        ///< [m] of the tool
  std::array<double, 3> force{}, rms{};                       ///< [N] truth: mean, variation about it
  double torque = 0.0;                                        ///< [N m] truth
  MotorMeasurement cut, air;                                  ///< ranges out of the signal chain
  std::optional<MotorForce> motors;                           ///< if a calibration is given
  std::optional<ForceEstimate> estimate;
  std::vector<ForceEstimate> windows;                ///< while the cut was steady
  std::array<std::optional<Estimate>, 3> bandwidth;  ///< [Hz] of the drives, estimated so far
  std::optional<MotorCalibration> learnt;            ///< from the session, if it learns
};

/// Passes every sample to the estimator as the node does. @param calibration empty: currents only, no forces.
/// @throws Error
std::vector<MotorCut> runDay(const MotorDay& day, const std::optional<MotorCalibration>& calibration,
                             const std::function<void(double share)>& progress = {});

/// Standard cuts (forces measured by a dynamometer on another machine) and currents of this machine.
MotorCalibration calibrationOf(const std::vector<MotorCut>& cuts);

/// Root mean square errors [N] of force along X and Y and of the tangential force T / r.
struct DayErrors {
  std::array<double, 3> regression{}, anfis{},
      old_air{};                              ///< old_air: regression with the first day's air cuts
  std::array<int, 3> count{}, anfis_count{};  ///< ANFIS refuses cuts outside its calibration
  /// For the estimated forces X, Y, Z: error and share within 1.96 standard deviations, of means and
  /// variations.
  std::array<double, 3> estimate{}, inside{}, inside_rms{};
  /// The same of the windows while a cut is steady.
  std::array<double, 3> window{}, inside_window{}, inside_window_rms{};
  int windows = 0;
  /// Of the variations X, Y, Z, of cuts and of windows: error [N], root mean square of the stated deviation
  /// [N], share within 0.674 standard deviations (half, if calibrated).
  struct Variation {
    std::array<double, 3> error{}, stated{}, half{};
  };
  Variation variation, variation_window;
};
/// @param learnt the cuts of the first day, whose air currents old_air uses.
DayErrors judgeDay(const std::vector<MotorCut>& learnt, const MotorCalibration& calibration,
                   const std::vector<MotorCut>& cuts);

}  // namespace smartmill::loadmeter
