#include "node/parameters_ros.h"

#include "smartmill_core/error.h"

namespace smartmill::kalman {

NodeParameters readParameters(ParameterReader& reader) {
  NodeParameters parameters;
  CompensationParameters& compensation = parameters.compensation;
  reader.read("bandwidth", compensation.filter.bandwidth);
  reader.read("max_harmonics", compensation.filter.max_harmonics);
  reader.read("noise_rms", compensation.filter.noise_rms);
  reader.read("settling_revolutions", compensation.filter.settling_revolutions);
  reader.read("memory_revolutions", compensation.filter.memory_revolutions);
  reader.read("least_speed", compensation.least_speed);
  reader.read("speed_tolerance", compensation.speed_tolerance);
  reader.read("lag", compensation.lag);
  reader.read("track_speed", compensation.track_speed);
  reader.read("speed_std", compensation.tracker.speed_std);
  reader.read("acceleration_std", compensation.tracker.acceleration_std);
  reader.read("settling_periods", compensation.settling_periods);
  reader.read("follow", compensation.follow);
  reader.read("follow_revolutions", compensation.follow_revolutions);
  reader.read("follow_misfit", compensation.follower.misfit);
  reader.read("saturation", compensation.saturation);
  TapParameters& taps = parameters.taps;
  reader.read("trigger_force", taps.trigger_force);
  reader.read("weak_force", taps.weak_force);
  reader.read("second_hit_share", taps.second_hit_share);
  reader.read("pre_trigger", taps.pre_trigger);
  reader.read("record_length", taps.record_length);
  reader.read("rest_time", taps.rest_time);
  reader.read("strike_timeout", taps.strike_timeout);
  reader.read("max_bad_hits", taps.max_bad_hits);
  reader.read("static_tolerance", taps.static_tolerance);
  reader.read("systematic", taps.systematic);
  reader.read("frf_high", taps.frf_high);
  reader.read("fit_low", taps.fit_low);
  reader.read("fit_high", taps.fit_high);
  reader.read("max_modes", taps.max_modes);
  taps.response_range = compensation.saturation;
  reader.read("model", parameters.model);
  reader.read("sensor_matrix", parameters.sensor_matrix);
  reader.read("spindle_sensor", parameters.spindle_sensor);
  reader.read("spindle_sensor_length", parameters.spindle_sensor_length);
  reader.read("command_machine", parameters.command_machine);
  reader.read("hold_back", parameters.hold_back);
  reader.read("wrench_rate", parameters.wrench_rate);
  reader.read("drift_limit", parameters.drift_limit);
  reader.read("model_max_age", parameters.model_max_age);
  reader.read("input_timeout", parameters.input_timeout);
  reader.finish();
  compensation.validate();
  taps.validate();
  if (!(parameters.spindle_sensor_length > 0.0)) throw Error("spindle_sensor_length: above 0 m is due");
  if (!(parameters.hold_back >= 0.0)) throw Error("hold_back: at least 0 s is due");
  if (!(parameters.wrench_rate > 0.0)) throw Error("wrench_rate: above 0 Hz is due");
  if (!(parameters.drift_limit >= 0.0)) throw Error("drift_limit: at least 0 N is due");
  if (!(parameters.model_max_age >= 0.0)) throw Error("model_max_age: at least 0 s is due");
  if (!(parameters.input_timeout > 0.0)) throw Error("input_timeout: above 0 s is due");
  return parameters;
}

}  // namespace smartmill::kalman
