#pragma once

#include <functional>
#include <string>
#include <vector>

#include "node/parameters.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::loadmeter {

/// Runs a recorded bag through the class that the node runs: cnc/state, cnc/load, daq/motor_current,
/// cut/condition and the action's goals.
/// @param progress called now and then with the share read, 0..1.
/// @param force called with each cut's force by the motors, where parameters name a motor calibration.
/// @param estimate called with each cut's force by all that was measured of it.
/// @return the answer to each goal in the bag that asked for coefficients; to one at its end when there is
/// none.
/// @throws Error on a bad bag.
std::vector<IdentifyResult> identifyFromBag(const std::string& path, const MachineModel& model,
                                            const NodeParameters& parameters,
                                            const std::function<void(double)>& progress,
                                            const std::function<void(const MotorForce&)>& force = {},
                                            const std::function<void(const ForceEstimate&)>& estimate = {});

}  // namespace smartmill::loadmeter
