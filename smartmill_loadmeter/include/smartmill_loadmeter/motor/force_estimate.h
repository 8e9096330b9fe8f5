#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_loadmeter/calibration/machine_calibration.h"
#include "smartmill_loadmeter/motor/drive_response.h"

namespace smartmill::loadmeter {

/// Prior knowledge of metals, and systematic errors of sensors in addition to their scatter.
struct ForceEstimateParameters {
  double radial_ratio = 0.35, radial_ratio_std = 0.15;
  double axial_ratio = 0.20, axial_ratio_std = 0.11;
  double radial_edge_ratio = 1.1, radial_edge_ratio_std = 0.5;
  double axial_edge_ratio = 0.2, axial_edge_ratio_std = 0.3;
  double model_error = 0.02;
  double motor_error = 0.03;
  double sensor_error = 0.02;
  double sensor_zero = 2.0;
  double period = 0.1;
  double window = 0.5;
  /// [N/m2], [N/m] prior of the tangential coefficients of metals, wide on purpose; no parameters of a node.
  double ktc = 1.5e9, ktc_std = 1.5e9;
  double kte = 2.5e4, kte_std = 2.5e4;

  void declare(ParameterTable& table);
};

/// Measurements of one cut. Forces act on the tool, in machine axes.
struct CutMeasurements {
  double stamp = 0.0;  ///< [s]
  std::string name;
  ToolGeometry tool;
  Engagement engagement;
  double heading = 0.0;                  ///< [rad] of the feed, from +X towards +Y, in turning towards +Z
  std::optional<Estimate> load_torque;   ///< [N m] cutting torque by the load meter
  std::optional<Estimate> motor_torque;  ///< [N m] by the spindle's current
  std::array<std::optional<Estimate>, 3> motor_force;  ///< [N] mean, of moving axes
  /// [N] alternative value if the cut pulls the axis along; empty: excluded.
  std::array<std::optional<Estimate>, 3> motor_other;
  double spindle_speed = 0.0;  ///< [rad/s] 0: unknown, no lines are estimated
  /// [N2] spectral lines of the feed drives' load, attenuated by their lag.
  std::array<std::vector<SpectralLine>, 3> motor_lines;
  std::array<std::optional<Estimate>, 3> bandwidth;     ///< [Hz] of the lag; empty: lines are not used
  std::array<std::optional<Estimate>, 3> sensor_force;  ///< [N] mean, of a force sensor
  std::array<std::optional<Estimate>, 3>
      sensor_rms;  ///< [N] RMS variation over a tooth period, of the sensor
};

/// Amplitude of the force at one frequency.
struct ForceLine {
  double frequency = 0.0;             ///< [Hz]
  std::array<Estimate, 3> amplitude;  ///< [N] machine X, Y, Z; NaN: not measured
};

/// Force of one cut. A component without a sensor follows from the others and the mechanics of the cut, with
/// a correspondingly larger standard deviation.
struct ForceEstimate {
  double stamp = 0.0;     ///< [s]
  double duration = 0.0;  ///< [s] averaged steady interval
  std::string name;
  std::array<Estimate, 3> mean;  ///< [N] static component: mean on the tool, machine X, Y, Z
  std::array<Estimate, 3> rms;   ///< [N] dynamic component: RMS about the mean over a tooth period
  std::vector<ForceLine> lines;  ///< spindle frequency (by the drives alone), tooth passing and harmonics
  Estimate torque;               ///< [N m] mean
  /// [1] chi2 of the measurements per measurement; well above 1: they disagree.
  double chi_square = 0.0;
  std::vector<std::string> sources;  ///< load_meter, motor_spindle, motor_x.., sensor
  /// For example "Fx -120.1 +- 3.0 N, Fy ..".
  std::string text() const;
};

/// Estimates the force of a cut from load meter, motor currents and force sensor: weighted least squares of
/// the six cutting coefficients through the cut's mechanics. Unknowns are Ktc, Kte and the ratios of the
/// others to these, with a prior for metals; the forces and their standard deviations follow from the
/// coefficients. The spectral lines of a feed drive are compared with those of the mechanics through its lag
/// H(f), with bandwidth and motor constant as unknowns: components that the drive does not follow remain as
/// uncertain as cut and metal leave them, without a division by a small H.
/// @throws Error without measurements, or with one that has no standard deviation.
ForceEstimate estimateForce(const CutMeasurements& measurements, const ForceEstimateParameters& parameters);

}  // namespace smartmill::loadmeter
