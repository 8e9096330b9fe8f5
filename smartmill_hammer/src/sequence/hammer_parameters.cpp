#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_hammer/sequence/hammer_sequence.h"

namespace smartmill {
namespace hammer {
namespace {

constexpr double BLOCK = 0.02;  // [s] longest of the sensors' streams

void declareSearch(HammerParameters& p, ParameterTable& table) {
  table.section("Flute search.");
  table.number("start_angle", p.start_angle, "rad", {}, "of the spindle, where the search begins");
  table.number("bracket_first_step", p.bracket_first_step, "rad", Range::positive(), "5.6 deg");
  table.number("bracket_max_step", p.bracket_max_step, "rad", Range::open(0.0, units::PI),
               "22.5 deg; at least bracket_first_step");
  table.number("flute_tolerance", p.flute_tolerance, "rad", Range::positive(), "1.5 deg");
  table.number("noise_sigmas", p.noise_sigmas, "1", Range::positive(),
               "of a mean voltage; a fall or rise counts above this");
  table.number("least_rise", p.least_rise, "V", Range::notNegative(), "and above this");
  table.number("golden_only", p.golden_only, "1", Range::closed(0, 1),
               "1: golden section alone, as the thesis; 0: parabolas too, which need fewer moves");
}

void declareCommands(HammerParameters& p, ParameterTable& table) {
  table.section("When a command is done.");
  table.number("command_delay", p.command_delay, "s", Range::atLeast(BLOCK),
               "before a command is judged: the controller begins late; longer than a block");
  table.number("settle_time", p.settle_time, "s", Range::atLeast(BLOCK),
               "from standstill to the voltage reading; longer than a block");
  table.number("averaging_time", p.averaging_time, "s", Range::positive(), "of voltage averaged");
  table.number("angle_tolerance", p.angle_tolerance, "rad", Range::positive(), "spindle at its angle");
  table.number("zero_speed", p.zero_speed, "rad/s", Range::positive(), "spindle at rest below this");
  table.number("rest_readings", p.rest_readings, "1", Range::atLeast(1), "of the spindle in a row");
  table.number("position_tolerance", p.position_tolerance, "m", Range::positive(),
               "axis at its place; of a small jog a quarter of its distance");
  table.number("orient_timeout", p.orient_timeout, "s", Range::positive(),
               "of turning the spindle to an angle");
  table.number("motion_timeout", p.motion_timeout, "s", Range::positive(), "of a motion of the axes");
}

void declarePaths(HammerParameters& p, ParameterTable& table) {
  table.section("Paths.");
  table.number("standoff", p.standoff, "m", Range::notNegative(),
               "sideways distance from the station while going down to it and up from it");
  table.number("retract_height", p.retract_height, "m", Range::positive(),
               "above the station's position: sideways motion is safe there");
  table.number("approach_feed", p.approach_feed, "m/s", Range::positive(), "to the station and from it");
  table.number("jog_feed", p.jog_feed, "m/s", Range::positive(), "of the calibration; thesis: 60 mm/min");
  table.number("near_path", p.near_path, "m", Range::notNegative(),
               "last part of the way to the station, at jog_feed and watching the sensor; at most standoff");
}

void declareCalibration(HammerParameters& p, ParameterTable& table) {
  table.section("Sensor calibration.");
  table.number("first_jog", p.first_jog, "m", Range::positive(), "at least least_jog");
  table.number("max_jog", p.max_jog, "m", Range::openLow(0.0, 1e-3), "at least first_jog");
  table.number("least_jog", p.least_jog, "m", Range::positive(), "at least 4 x resolution");
  table.number("resolution", p.resolution, "m", Range::positive(), "of a commanded distance");
  table.number("zero_volt", p.zero_volt, "V", Range::positive(),
               "the sensor is in the middle of its range within this");
  table.number(
      "check_jog", p.check_jog, "m", Range::notNegative(),
      "half width of the symmetric sensitivity measurement, at least least_jog; 0: the thesis's way");
  table.number("position_std", p.position_std, "m", Range::notNegative(), "of a distance moved");
  table.number("min_gap_share", p.min_gap_share, "1", Range::open(0.0, 1.0),
               "of gap_at_zero_volt: no nearer");
  table.number(
      "sensor_face", p.sensor_face, "m", Range::closed(0.0, 0.1),
      "diameter of the sensor's face, which the tool beside the sensor's middle must not touch either");
  table.number("sensor_electrode", p.sensor_electrode, "m", Range::closed(0.0, 0.1),
               "diameter of the part of it that sees");
  table.number(
      "curve_error", p.curve_error, "1", Range::closed(0.0, 0.5),
      "by which the sensor's voltage may stand off its nominal curve's before it is calibrated: what is "
      "read of the tool's flanks is believed so far only");
  table.number(
      "curve_jog", p.curve_jog, "m", Range::closed(0.0, 1e-3),
      "away from the sensor, at the calibration's end: how far the curve's bend is read; 0: only by the "
      "approach's readings");
  table.number("max_approach", p.max_approach, "m", Range::positive(),
               "to the sensor, beyond the depth between two flutes");
}

void declareTip(HammerParameters& p, ParameterTable& table) {
  table.section("From the struck height to the tip, where the goal tells the stick-out.");
  table.choice("tip_correction", p.tip_correction, {"apart", "eq_4_44"},
               "apart: modes of spindle and tool each by its own shape, the tool a beam; eq_4_44: one factor "
               "for all, the thesis's");
  table.number("second_height", p.second_height, "1", Range::closed(0, 1),
               "1: half as many hits again with the tool lowered by half the hammer's offset, which tell how "
               "the spindle's modes turn");
  table.number("read_height", p.read_height, "m", Range::closed(0.0, 0.05),
               "of the sensor's centre above the tip at the station; the hammer stands its offset above the "
               "sensor");
  table.number("height_std", p.height_std, "m", Range::notNegative(), "to which heights are known");
  table.number("stickout_std", p.stickout_std, "m", Range::notNegative(), "of the goal's stick-out");
  table.choice(
      "tool_material", p.tool_material, {"unknown", "carbide", "steel"},
      "of the tool's body; unknown: what only the tool's beam tells, of modes above the band, stays a doubt");
  table.number("tool_fluted_length", p.tool_fluted_length, "m", Range::closed(0.0, 0.5),
               "of the tool, from its tip, within 1 mm; 0: not known, some two diameters");
}

}  // namespace

void HammerParameters::declare(ParameterTable& table) {
  declareSearch(*this, table);
  declareCommands(*this, table);
  declarePaths(*this, table);
  declareCalibration(*this, table);
  table.section("Hits.");
  declareHits(table);
  table.number("force_high", force_high, "Hz", Range::notNegative(),
               "the blow must have power up to here, a dull one is repeated; 0: not asked");
  table.number(
      "asked_std", asked_std, "1", Range::notNegative(),
      "of the FRF over the fit's band, relative: fewer hits than the goal's when they reach it, three at "
      "least; 0: as many as the goal says");
  table.number("exponential_time", exponential_time, "s", Range::notNegative(),
               "time constant of an exponential window; 0: none");
  table.number("straighten_sensor", straighten_sensor, "1", Range::closed(0, 1),
               "1: bend the sensor's curve straight over the vibration, as calibrated; 0: linear");
  table.number(
      "averaged_share", averaged_share, "1", Range::closed(0.0, 1.0),
      "of the time between two samples, over which the converter averages the sensor's bent curve; 0: "
      "it samples");
  table.number(
      "coil_share", coil_share, "1", Range::closed(0.0, 0.2),
      "of a channel's largest, that the solenoid's current may add to it: what is full until the touch "
      "and then dies away is taken off; 0: nothing is");
  table.number("axes_turn_std", axes_turn_std, "rad", Range::closed(0.0, 0.5),
               "by which the station's axes may be turned against the structure's own: modes across show by "
               "its square");
  table.number("cross_frf", cross_frf, "1", Range::closed(0, 1),
               "1: where a second sensor stands at right angles (channel gap_cross), read it too");
  declareTip(*this, table);
  table.section("FRF and fit.");
  declareFit(table);
}

void HammerParameters::validate() const {
  checkBounds(*this);
  validateHitTest();
  const auto need = [](bool good, const char* key, double value, const char* due) {
    if (!good) throw Error(std::string(key) + ": " + shortNumber(value) + ", " + due + " is due");
  };
  need(bracket_max_step >= bracket_first_step, "bracket_max_step", bracket_max_step,
       "at least bracket_first_step");
  need(least_jog >= 4.0 * resolution, "least_jog", least_jog, "at least 4 x resolution");
  need(first_jog >= least_jog, "first_jog", first_jog, "at least least_jog");
  need(max_jog >= first_jog, "max_jog", max_jog, "at least first_jog");
  need(near_path <= standoff, "near_path", near_path, "at most standoff");
  need(check_jog == 0.0 || check_jog >= least_jog, "check_jog", check_jog, "0 or at least least_jog");
}

}  // namespace hammer
}  // namespace smartmill
