#include "parameters_ros.h"

#include <algorithm>
#include <vector>

#include "smartmill_core/error.h"

namespace smartmill::loadmeter {

NodeParameters readParameters(ParameterReader& reader) {
  NodeParameters parameters;
  IdentificationParameters& identification = parameters.identification;
  reader.read("model", parameters.model);
  reader.read("database", parameters.database);
  reader.read("speed_tolerance", identification.speed_tolerance);
  reader.read("settle_time_constants", identification.settle_time_constants);
  reader.read("guard_time", identification.guard_time);
  reader.read("path_tolerance", identification.path_tolerance);
  reader.read("minimum_readings", identification.minimum_readings);
  reader.read("maximum_gap", identification.maximum_gap);
  reader.read("production_memory", identification.production_memory);
  reader.read("largest_runout", identification.largest_runout);
  reader.read("motor_calibration", parameters.motor_calibration);
  MotorParameters& motor = identification.motor;
  std::vector<double> per_metre(motor.phase_per_metre.begin(), motor.phase_per_metre.end());
  reader.read("motor_phase_per_metre", per_metre);
  if (per_metre.size() != 3) {
    throw Error("motor_phase_per_metre: " + std::to_string(per_metre.size()) + " numbers, three are due");
  }
  std::copy(per_metre.begin(), per_metre.end(), motor.phase_per_metre.begin());
  reader.read("motor_phase_per_revolution", motor.phase_per_revolution);
  reader.read("motor_smallest_velocity", motor.smallest_velocity);
  reader.read("hold_back", parameters.hold_back);
  reader.read("input_timeout", parameters.input_timeout);
  reader.finish();
  identification.validate();
  if (!parameters.motor_calibration.empty() && !motor.any()) {
    throw Error("motor_phase_per_metre: all 0, and motor_phase_per_revolution too: no current can be read");
  }
  if (!(parameters.input_timeout > 0.0)) {
    throw Error("input_timeout: " + std::to_string(parameters.input_timeout) + " is out of range (> 0)");
  }
  return parameters;
}

}  // namespace smartmill::loadmeter
