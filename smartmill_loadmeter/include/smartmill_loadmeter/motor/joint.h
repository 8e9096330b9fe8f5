#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_loadmeter/calibration/machine_calibration.h"

namespace smartmill::loadmeter {

/// A feed drive: F = m (I - Ia), Cheng & Venuvinod eq. 3; m is negative when the weight aids the motion more
/// than friction opposes it.
struct FeedDrive {
  double newton_per_ampere = 0.0;      ///< [N/A] m, per range of the current
  double newton_per_ampere_std = 0.0;  ///< [N/A]
  double air_current = 0.0;            ///< [A] range in air, same direction of motion
  double current_std = 0.0;            ///< [A] of a mean current

  /// Cutting force that opposes the drive's motion [N].
  Estimate opposing(double current) const;
};

/// Measurements of one cut. The force of an axis acts on the tool along the machine axis; empty for an axis
/// at rest, whose motor current does not show the load: the passive component is unknown and no value is
/// assumed.
struct JointMeasurement {
  ToolGeometry tool;
  Engagement engagement;
  double heading = 0.0;            ///< [rad] of the feed in the X-Y plane, from +X towards +Y
  std::optional<Estimate> torque;  ///< [N m] mean cutting torque
  std::array<std::optional<Estimate>, 3> axis_force;  ///< [N] mean, X, Y, Z
};

/// Force on the tool along an axis from its drive; empty below the speed of an axis at rest.
std::optional<Estimate> axisForce(const FeedDrive& drive, double current, double velocity, double smallest);

struct JointResult {
  CuttingCoefficients value, std_dev;  ///< NaN where not observable
  std::array<double, 36>
      covariance{};  ///< row by row, order ktc krc kac kte kre kae; NaN where not observable
  std::vector<std::string> not_observable;  ///< names of these coefficients
  int measurements = 0;
};

/// All six coefficients from torque and the forces of moving axes together, weighted by their standard
/// deviations; coefficients that the data do not determine are listed.
/// @throws Error when none is observable.
JointResult identifyJointly(const std::vector<JointMeasurement>& measurements);

}  // namespace smartmill::loadmeter
