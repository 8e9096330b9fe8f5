#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "smartmill_core/campaign/record.h"
#include "smartmill_loadmeter/calibration/machine_calibration.h"

namespace smartmill::loadmeter {

/// Motion and motor current of one axis in one record; nothing cuts.
struct AxisMotion {
  double sample_rate = 0.0;      ///< [Hz]
  std::vector<double> velocity;  ///< [m/s]
  std::vector<double> current;   ///< [A], one for each velocity
};

/// Reads columns axis_v<axis> (or axis_<axis>, differentiated) and current_<axis> of a record.
/// @param axis 'x', 'y' or 'z'. @throws Error that names the file and the missing column.
AxisMotion axisMotion(const Record& record, double sample_rate, char axis);

struct AxisDriveOptions {
  /// [s] length of the Hann window that smooths velocity, its sign and current alike: long compared with the
  /// controller's cycle (its held values are steps), short compared with an acceleration.
  double smoothing = 0.05;
  /// [1] of the windows' length: step between the rows of the regression.
  double step = 0.1;
  /// [windows] up to which residuals are taken as correlated, for the standard deviations.
  double correlated = 4.0;
  /// [1] Largest ratio of a parameter's standard deviation to that from an experiment that varied it alone:
  /// beyond, the moves do not separate it from the others.
  double inflation = 30.0;
};

/// Current of a feed drive that moves its axis in air: i = inertia dv/dt + coulomb sign(v) + viscous v +
/// offset.
struct AxisDrive {
  Estimate inertia;        ///< [A s2/m] moved mass over force per ampere
  Estimate coulomb;        ///< [A]
  Estimate viscous;        ///< [A s/m]
  Estimate offset;         ///< [A] weight of a vertical axis, offset of the amplifier
  double residual = 0.0;   ///< [A] RMS, of the smoothed current
  double explained = 0.0;  ///< [1] share of the variance of the smoothed current
  double largest_velocity = 0.0, largest_acceleration = 0.0;  ///< [m/s], [m/s2] of the smoothed motion

  std::string text() const;  ///< one line
};

/// Least squares over all records. Velocity, sign of the velocity and current pass through the same window,
/// so that smoothing biases none of the parameters. Standard deviations allow for the correlation of the
/// residuals (Newey and West 1987).
/// @throws Error for no record, records shorter than the window, an axis that does not move, accelerate or
/// change its direction.
AxisDrive identifyAxisDrive(const std::vector<AxisMotion>& moves, const AxisDriveOptions& options = {});

}  // namespace smartmill::loadmeter
