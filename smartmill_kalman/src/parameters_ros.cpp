#include "parameters_ros.h"

#include "smartmill_core/error.h"

namespace smartmill::kalman {

NodeParameters readParameters(ParameterReader& reader) {
  NodeParameters parameters;
  CompensationParameters& compensation = parameters.compensation;
  reader.read("bandwidth", compensation.filter.bandwidth);
  reader.read("max_harmonics", compensation.filter.max_harmonics);
  reader.read("noise_rms", compensation.filter.noise_rms);
  reader.read("settling_revolutions", compensation.filter.settling_revolutions);
  reader.read("least_speed", compensation.least_speed);
  reader.read("speed_tolerance", compensation.speed_tolerance);
  reader.read("settling_periods", compensation.settling_periods);
  reader.read("saturation", compensation.saturation);
  reader.read("model", parameters.model);
  reader.read("hold_back", parameters.hold_back);
  reader.read("wrench_rate", parameters.wrench_rate);
  reader.read("input_timeout", parameters.input_timeout);
  reader.finish();
  compensation.validate();
  if (parameters.model.empty()) throw Error("model: the path of a smartmill-model/1 file is due");
  if (!(parameters.hold_back >= 0.0)) throw Error("hold_back: at least 0 s is due");
  if (!(parameters.wrench_rate > 0.0)) throw Error("wrench_rate: above 0 Hz is due");
  if (!(parameters.input_timeout > 0.0)) throw Error("input_timeout: above 0 s is due");
  return parameters;
}

}  // namespace smartmill::kalman
