#include "parameters_ros.h"

#include "hammer_server.h"
#include "smartmill_core/error.h"
#include "smartmill_ros/parameter_reader.h"

namespace smartmill {
namespace hammer {

void readParameters(ParameterReader& reader, HammerParameters& parameters, NodeParameters& node) {
  reader.read("start_angle", parameters.start_angle);
  reader.read("bracket_first_step", parameters.bracket_first_step);
  reader.read("bracket_max_step", parameters.bracket_max_step);
  reader.read("flute_tolerance", parameters.flute_tolerance);
  reader.read("noise_sigmas", parameters.noise_sigmas);
  reader.read("least_rise", parameters.least_rise);
  reader.read("command_delay", parameters.command_delay);
  reader.read("settle_time", parameters.settle_time);
  reader.read("averaging_time", parameters.averaging_time);
  reader.read("angle_tolerance", parameters.angle_tolerance);
  reader.read("zero_speed", parameters.zero_speed);
  reader.read("rest_readings", parameters.rest_readings);
  reader.read("position_tolerance", parameters.position_tolerance);
  reader.read("orient_timeout", parameters.orient_timeout);
  reader.read("motion_timeout", parameters.motion_timeout);
  reader.read("standoff", parameters.standoff);
  reader.read("retract_height", parameters.retract_height);
  reader.read("approach_feed", parameters.approach_feed);
  reader.read("jog_feed", parameters.jog_feed);
  reader.read("first_jog", parameters.first_jog);
  reader.read("max_jog", parameters.max_jog);
  reader.read("least_jog", parameters.least_jog);
  reader.read("resolution", parameters.resolution);
  reader.read("zero_volt", parameters.zero_volt);
  reader.read("check_jog", parameters.check_jog);
  reader.read("position_std", parameters.position_std);
  reader.read("min_gap_share", parameters.min_gap_share);
  reader.read("max_approach", parameters.max_approach);
  reader.read("trigger_force", parameters.trigger_force);
  reader.read("weak_force", parameters.weak_force);
  reader.read("second_hit_share", parameters.second_hit_share);
  reader.read("pre_trigger", parameters.pre_trigger);
  reader.read("record_length", parameters.record_length);
  reader.read("rest_time", parameters.rest_time);
  reader.read("strike_timeout", parameters.strike_timeout);
  reader.read("max_bad_hits", parameters.max_bad_hits);
  reader.read("exponential_time", parameters.exponential_time);
  reader.read("straighten_sensor", parameters.straighten_sensor);
  reader.read("frf_high", parameters.frf_high);
  reader.read("fit_low", parameters.fit_low);
  reader.read("fit_high", parameters.fit_high);
  reader.read("max_modes", parameters.max_modes);
  parameters.validate();
  reader.read("hold_back", node.hold_back);
  reader.read("stale_timeout", node.stale_timeout);
  if (!(node.hold_back >= 0.0))
    throw Error("hammer parameter hold_back: " + std::to_string(node.hold_back) + ", at least 0 is due");
  if (!(node.stale_timeout > 0.0)) {
    throw Error("hammer parameter stale_timeout: " + std::to_string(node.stale_timeout) + ", above 0 is due");
  }
}

}  // namespace hammer
}  // namespace smartmill
