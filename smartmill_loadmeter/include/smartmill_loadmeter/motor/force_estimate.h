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

/// What is known of any metal before a cut, and how good sensors are beyond what their own scatter says.
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

  void declare(ParameterTable& table);
};

/// What one cut showed. Forces: on the tool, machine axes.
struct ForceReadings {
  double stamp = 0.0;  ///< [s]
  std::string name;
  ToolGeometry tool;
  Engagement engagement;
  double heading = 0.0;                  ///< [rad] of the feed in the X-Y plane, from +X towards +Y
  std::optional<Estimate> load_torque;   ///< [N m] of the cut, by the load meter
  std::optional<Estimate> motor_torque;  ///< [N m] by the spindle's current
  std::array<std::optional<Estimate>, 3> motor_force;  ///< [N] mean, of axes that moved
  /// [N] what that is where the cut pulls the axis on; empty: it cannot be.
  std::array<std::optional<Estimate>, 3> motor_other;
  double spindle_speed = 0.0;  ///< [rad/s] 0: not known, no lines are told
  /// [N2] lines of the feed drives' load, as their lag leaves them.
  std::array<std::vector<VariationLine>, 3> motor_lines;
  std::array<std::optional<Estimate>, 3> bandwidth;     ///< [Hz] of that lag; empty: lines are not used
  std::array<std::optional<Estimate>, 3> sensor_force;  ///< [N] mean, of a force sensor
  std::array<std::optional<Estimate>, 3> sensor_rms;    ///< [N] variation over a tooth, of the sensor
};

/// What the force varies by at one frequency.
struct ForceLine {
  double frequency = 0.0;             ///< [Hz]
  std::array<Estimate, 3> amplitude;  ///< [N] machine X, Y, Z; NaN: nobody saw it
};

/// All three components of one cut. A component that no sensor saw is what the others and the mechanics of
/// the cut say of it, as uncertain as that is.
struct ForceEstimate {
  double stamp = 0.0;     ///< [s]
  double duration = 0.0;  ///< [s] steady, that it is the mean of
  std::string name;
  std::array<Estimate, 3> mean;  ///< [N] static part: mean on the tool, machine X, Y, Z
  std::array<Estimate, 3> rms;   ///< [N] dynamic part: root mean square about the mean, over a tooth
  std::vector<ForceLine> lines;  ///< the revolution's by the drives alone, tooth passing and its harmonics
  Estimate torque;               ///< [N m] mean
  /// [1] squared distance of the readings from the estimate over their number; much above 1: they disagree.
  double surprise = 0.0;
  std::vector<std::string> sources;  ///< load_meter, motor_spindle, motor_x.., sensor
  /// E.g. "Fx -120.1 +- 3.0 N, Fy ..".
  std::string text() const;
};

/// One estimator of load meter, motor currents and force sensor: six cutting coefficients as Ktc, Kte and the
/// ratios of the others to these, whose prior any metal obeys, weighted least squares with the cut's
/// mechanics; the forces and their deviations follow from the coefficients'. A feed drive's lines stand
/// beside the mechanics' through its lag H(f), whose bandwidth and whose motor's constant are unknowns too:
/// what the drive does not follow is as unsure as cut and metal leave it, and no quotient by a small H is
/// ever formed.
/// @throws Error without any reading, or with one that has no standard deviation.
ForceEstimate estimateForce(const ForceReadings& readings, const ForceEstimateParameters& parameters);

}  // namespace smartmill::loadmeter
