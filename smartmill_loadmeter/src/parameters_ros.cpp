#include "parameters_ros.h"

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
  reader.read("hold_back", parameters.hold_back);
  reader.read("input_timeout", parameters.input_timeout);
  reader.finish();
  identification.validate();
  if (!(parameters.input_timeout > 0.0)) {
    throw Error("input_timeout: " + std::to_string(parameters.input_timeout) + " is out of range (> 0)");
  }
  return parameters;
}

}  // namespace smartmill::loadmeter
