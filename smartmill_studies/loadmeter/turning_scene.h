#pragma once

#include <array>
#include <random>
#include <string>
#include <vector>

#include "smartmill_loadmeter/motor/motor_current.h"

namespace smartmill::loadmeter {

/// The turning centre of Cheng & Venuvinod: X slide inclined, its weight aiding the infeed; Y the spindle, 11
/// kW, base speed 1570 rpm; Z horizontal. Phase currents at 1000 Hz with harmonics and Hall-sensor noise.
struct TurningVariances {
  std::array<double, 3> process{{100.0, 84.0, 320.0}};  ///< [N2] Fx, Fy, Fz; Table 2 (Fx: not given, assumed)
  std::array<double, 3> sensor{{260.0, 383.0, 260.0}};  ///< [N2] Table 2 (Fx: as Fz)
};

/// One cut with the measurements of machine and dynamometer.
struct TurningCut {
  bool moves_x = false, moves_z = false;
  double speed_rpm = 0.0, feed = 0.0, depth = 0.0;  ///< [rpm], [m/rev], [m]
  double radius = 0.0;                              ///< [m] of the workpiece
  std::array<double, 3> force{};                    ///< [N] dynamometer: Fx, Fy, Fz
  std::array<double, 3> current{};  ///< [A] phase ranges X, Y, Z out of the signal chain; NaN: axis at rest
  double spindle_air = 0.0;         ///< [A] range of the spindle's current in air at this speed
};

class TurningCentre {
 public:
  TurningCentre(unsigned seed, const TurningVariances& variances);

  /// Longitudinal and facing cuts, one material, two tools (Table 1: 105 and 13 + 2).
  std::vector<TurningCut> calibrationTests(std::size_t count);
  /// Three materials, three tools; also tapers and contours, where all axes move.
  std::vector<TurningCut> predictionTests(std::size_t count);
  /// The cut of Table 2: 1000 rpm, 2 mm, 0.2 mm/rev, repeated.
  std::vector<TurningCut> replications(std::size_t count);

  /// [A] Phase current at 1000 Hz of a range [A] over time, with the inverter's harmonics and the sensor's
  /// noise. @param frequency [Hz] of the phase
  std::vector<double> phaseCurrent(const std::vector<double>& range, double frequency);

  static constexpr double BASE_SPEED = 1570.0;  ///< [rpm]

 private:
  TurningCut cut(double kc, bool x, bool z, double speed_rpm, double feed, double depth, double radius);
  double measured(double range, double frequency);

  std::mt19937 random_;
  std::normal_distribution<double> normal_;
  TurningVariances variances_;
};

/// Load of a slide from its drive's line and air cuts in both directions (section 9, ii): in the direction
/// of the calibration m I = W + R, against it |m| I' = |W| + R.
struct SlideLoad {
  Estimate weight;    ///< [N] W, opposing the calibrated motion; negative: aids it
  Estimate friction;  ///< [N] R
};
SlideLoad slideLoad(const Line& calibration, double air_current, double air_current_reverse,
                    double current_std);

/// Section 12: replications of one cut, measured by the dynamometer (process only) and by the current.
struct VarianceSplit {
  double process_mean = 0.0, current_mean = 0.0;          ///< [N]
  double process_variance = 0.0, current_variance = 0.0;  ///< [N2]
  double sensor_variance = 0.0;  ///< [N2] of the measurement by current: the difference, not below 0
  double f_means = 0.0;          ///< [1] F of the difference of the means (1 and 2 n - 2 degrees of freedom)
  double p_means = 1.0;          ///< [1] probability of such an F without a difference
  double p_variances = 1.0;  ///< [1] probability of such a ratio of variances without a difference, one-sided
};
/// @throws Error with fewer than three replications on either side.
VarianceSplit splitVariance(const std::vector<double>& dynamometer, const std::vector<double>& current);

/// RMSE [N] and coefficient of determination of Fx, Fy, Fz over the cuts in which the axis moves.
struct Agreement {
  std::array<double, 3> rmse{}, r_squared{};
  std::array<int, 3> count{};
};

/// RMSE of the two thirds of the prediction tests that were not used for selection.
/// All results of the paper for one calibration and one prediction set.
struct TurningResult {
  Line x, z;                                            ///< F = m I + c
  Agreement regression;                                 ///< of the prediction tests
  Agreement anfis;                                      ///< Fy and Fz (0, 1, 2 as above; Fx: the line)
  std::string fy_inputs, fz_inputs;                     ///< the selected input arrays
  double fit_x = 0.0, fit_y = 0.0, fit_z = 0.0;         ///< R2 of the calibration
  VarianceSplit fy, fz;                                 ///< of the replications
  std::array<std::vector<double>, 3> truth, predicted;  ///< [N] of the prediction tests, by regression
};
TurningResult studyTurning(unsigned seed, const TurningVariances& variances, std::size_t replications);

}  // namespace smartmill::loadmeter
