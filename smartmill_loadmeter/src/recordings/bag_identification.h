#pragma once

#include <functional>
#include <string>
#include <vector>

#include "node/parameters.h"
#include "smartmill_core/cutting/force_curve.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::loadmeter {

/// What is called on the way; empty: not.
struct BagListeners {
  std::function<void(double)> progress;           ///< now and then, with the share read, 0..1
  std::function<void(const MotorForce&)> motors;  ///< a cut's force by the motors, where they are calibrated
  std::function<void(const ForceEstimate&)> force;    ///< a cut's force by all that was measured of it
  std::function<void(const CoefficientRecord&)> cut;  ///< every cut, as it enters the database
};

/// Runs a recorded bag through the class that the node runs: cnc/state, cnc/load, daq/motor_current,
/// cut/condition and the action's goals.
/// @return the answer to each goal in the bag that asked for coefficients; to one at its end when there is
/// none.
/// @throws Error on a bad bag.
std::vector<IdentifyResult> identifyFromBag(const std::string& path, const MachineModel& model,
                                            const NodeParameters& parameters,
                                            const BagListeners& listeners = {});

/// The force curves of a bag, the last of each tool and material, by the class that the node runs.
/// @throws Error when it holds no force/compensated or spindle/angle, or no cut makes one (each with its
/// reason).
std::vector<IdentifiedForceCurves> curvesFromBag(const std::string& path, const NodeParameters& parameters,
                                                 const std::function<void(double)>& progress = {});

}  // namespace smartmill::loadmeter
