#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_loadmeter/calibration/machine_calibration.h"

namespace smartmill::loadmeter {

/// A feed drive: F = m (I - Ia), Cheng & Venuvinod eq. 3; m is negative where weight aids the motion more
/// than friction opposes it.
struct FeedDrive {
  double newton_per_ampere = 0.0;      ///< [N/A] m, of the current's range
  double newton_per_ampere_std = 0.0;  ///< [N/A]
  double air_current = 0.0;            ///< [A] range in air, same direction of motion
  double current_std = 0.0;            ///< [A] of a mean current

  /// Cutting force that opposes the drive's motion [N].
  Estimate opposing(double current) const;
};

/// What one cut showed. Force of an axis: on the tool, along the machine axis; empty where the axis stood
/// still: a motor shows no load without motion, the passive component is unknown and nothing is put in its
/// place.
struct JointReading {
  ToolGeometry tool;
  Engagement engagement;
  double heading = 0.0;            ///< [rad] of the feed in the X-Y plane, from +X towards +Y
  std::optional<Estimate> torque;  ///< [N m] mean cutting torque
  std::array<std::optional<Estimate>, 3> axis_force;  ///< [N] mean, X, Y, Z
};

/// Force on the tool along an axis from its drive; empty below the speed at which it counts as standing
/// still.
/// @param velocity [m/s] of the tool against the workpiece. @param smallest [m/s] > 0.
std::optional<Estimate> axisForce(const FeedDrive& drive, double current, double velocity, double smallest);

struct JointResult {
  CuttingCoefficients value, std_dev;       ///< NaN where not observable
  std::array<double, 36> covariance{};      ///< row by row, order ktc krc kac kte kre kae; NaN rows likewise
  std::vector<std::string> not_observable;  ///< names of coefficients these readings say nothing about
  int readings = 0;
};

/// All six coefficients from torque and the forces of moving axes together, weighted by their standard
/// deviations; what the data leave open is named, not guessed.
/// @throws Error when nothing at all can be told.
JointResult identifyJointly(const std::vector<JointReading>& readings);

}  // namespace smartmill::loadmeter
