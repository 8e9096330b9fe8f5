#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_loadmeter/identification/identification_parameters.h"
#include "smartmill_loadmeter/motor/force_estimate.h"
#include "smartmill_loadmeter/motor/motor_calibration.h"
#include "smartmill_loadmeter/motor/motor_chain.h"
#include "smartmill_sim/turning/turning_machine.h"

namespace smartmill::loadmeter {

/// Cut of the simulated lathe (smartmill_sim/turning/turning_machine.h): truth, measurement and estimates.
struct LatheCut {
  std::string name;
  double radius = 0.0;               ///< [m] at half depth and half way
  std::array<double, 3> force{};     ///< [N] true mean on the tool, of the steady part
  double torque = 0.0;               ///< [N m] true mean
  MotorMeasurement cut, air;         ///< out of the signal chain
  std::optional<MotorForce> motors;  ///< if a calibration is given
  std::optional<ForceEstimate> estimate;
};

/// Parameters of loadmeter_node for this lathe, as in turning.launch. @param method regression or anfis
IdentificationParameters latheParameters(const std::string& method = "regression");
/// Regenerative cut that is stable at every spindle speed, as in turning.launch.
sim::LatheTraits latheTraits(double spindle_speed, std::uint64_t seed);
/// Standard cuts: longitudinal, taper and facing passes of several feeds and depths.
sim::TurningTraits standardPasses();

/// Does all passes once and passes the streams to the estimator as the node does. @param calibration empty:
/// currents only, no forces. @throws Error
std::vector<LatheCut> runLathe(const sim::LatheTraits& lathe, const sim::TurningTraits& turning,
                               const MachineModel& model, const IdentificationParameters& parameters,
                               const std::optional<MotorCalibration>& calibration);

/// Tables for `calibrate --standard-cuts CUTS --currents CURRENTS`. @throws Error.
void writeTables(const std::vector<LatheCut>& cuts, const std::string& cuts_file,
                 const std::string& currents_file);

}  // namespace smartmill::loadmeter
