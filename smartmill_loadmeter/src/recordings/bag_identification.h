#pragma once

#include <functional>
#include <string>
#include <vector>

#include "node/parameters.h"
#include "smartmill_core/cutting/force_curve.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_loadmeter/identification/servo_load.h"

namespace smartmill::loadmeter {

/// Callbacks; may be empty.
struct BagListeners {
  std::function<void(double)> progress;                    ///< share read, 0..1
  std::function<void(const MotorForce&)> motors;           ///< force of each cut by calibrated motors
  std::function<void(const ForceEstimate&)> force;         ///< force of each cut by all its measurements
  std::function<void(const CoefficientRecord&)> cut;       ///< record of every cut for the database
  std::function<void(const InspectionResult&)> inspected;  ///< every measured dimension of a part
};

/// Processes a bag with the class of the node: cnc/state, cnc/load, daq/motor_current, cut/condition and the
/// action's goals.
/// @return the result of each goal that requests coefficients, or of one at the end of the bag if there is
/// none.
/// @throws Error for an invalid bag.
std::vector<IdentifyResult> identifyFromBag(const std::string& path, const MachineModel& model,
                                            const NodeParameters& parameters,
                                            const BagListeners& listeners = {});

/// Spindle load of a record of Servo Guide in a bag, topic daq/servo. @throws Error without the topic.
ServoLoad servoLoadFromBag(const std::string& path, const std::function<void(double)>& progress = {});

/// Newest force curve of each tool and material in a bag, by the class of the node.
/// @throws Error when it has no force/compensated or spindle/angle, or no cut gives a curve (with the
/// reasons).
std::vector<IdentifiedForceCurves> curvesFromBag(const std::string& path, const NodeParameters& parameters,
                                                 const std::function<void(double)>& progress = {});

}  // namespace smartmill::loadmeter
