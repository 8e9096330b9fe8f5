#pragma once

#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_loadmeter/calibration/machine_calibration.h"
#include "smartmill_loadmeter/identification/load_test.h"

namespace smartmill::loadmeter {

/// Friction torque of a test as a function of the unknowns fitted to the air cuts.
struct IdleTorque {
  std::function<double(const LoadTest&)> torque;                 ///< [N m]
  std::function<std::vector<double>(const LoadTest&)> gradient;  ///< with respect to the unknowns
  std::size_t unknowns = 0;
  std::vector<double> covariance;                             ///< of the unknowns, row by row
  double viscous = std::numeric_limits<double>::quiet_NaN();  ///< [N m s/rad] fitted to the air cuts
  double coulomb = std::numeric_limits<double>::quiet_NaN();  ///< [N m]
};
/// Fits the friction law with the strongest evidence to the air cuts (Stribeck and warm-up terms from five
/// air cuts on); without air cuts, the model's friction. @throws Error with air cuts at fewer than two
/// speeds.
IdleTorque idleTorque(const std::vector<LoadTest>& air_cuts, const Spindle& spindle,
                      double spindle_uncertainty_percent);

/// Mean cutting torque [N m] of a cut by the load meter: eq. 3.5 without the friction of the air cuts. Air
/// cuts at one speed determine the friction of cuts at this speed only (within 5 %): of other cuts the torque
/// is empty.
std::optional<Estimate> cuttingTorque(const LoadTest& cut, const std::vector<LoadTest>& air_cuts,
                                      const Spindle& spindle, double spindle_uncertainty_percent);

}  // namespace smartmill::loadmeter
