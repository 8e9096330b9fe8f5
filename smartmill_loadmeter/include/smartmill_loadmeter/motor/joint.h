#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_loadmeter/calibration/machine_calibration.h"

namespace smartmill::loadmeter {

/// Measurements of one cut. The force of an axis acts on the tool along the machine axis; empty for an axis
/// at rest, whose motor current does not show the load: the passive component is unknown and no value is
/// assumed.
struct JointMeasurement {
  ToolGeometry tool;
  Engagement engagement;
  double heading = 0.0;            ///< [rad] of the feed, from +X towards +Y, in turning towards +Z
  std::optional<Estimate> torque;  ///< [N m] mean cutting torque
  std::array<std::optional<Estimate>, 3> axis_force;  ///< [N] mean, X, Y, Z
};

struct JointResult {
  CuttingCoefficients value, std_dev;  ///< NaN where not observable
  std::array<double, 36>
      covariance{};  ///< row by row, order ktc krc kac kte kre kae; NaN where not observable
  std::vector<std::string> not_observable;  ///< names of these coefficients
  int measurements = 0;
};

/// All six coefficients from torque and the forces of moving axes together, weighted by their standard
/// deviations; coefficients that the data do not determine are listed.
/// @param gain_error [1] standard deviation of a gain that all axis forces have in common, an unknown as well
/// @throws Error when none is observable.
JointResult identifyJointly(const std::vector<JointMeasurement>& measurements, double gain_error = 0.0);

}  // namespace smartmill::loadmeter
