#include "smartmill_hammer/sequence/hammer_parameters.h"

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::hammer {
namespace {

constexpr double BLOCK = 0.02;  // [s] longest sample block of a stream

void declareSearch(HammerParameters& p, ParameterTable& table) {
  table.section("Flute search.");
  table.number("start_angle", p.start_angle, "rad", {}, "spindle angle at which the search begins");
  table.number("bracket_first_step", p.bracket_first_step, "rad", Range::positive(), "5.6 deg");
  table.number("bracket_max_step", p.bracket_max_step, "rad", Range::open(0.0, units::PI),
               "22.5 deg; at least bracket_first_step");
  table.number("flute_tolerance", p.flute_tolerance, "rad", Range::positive(), "1.5 deg");
  table.number("noise_sigmas", p.noise_sigmas, "1", Range::positive(),
               "standard deviations of a mean voltage above which a difference is significant");
  table.number("least_rise", p.least_rise, "V", Range::notNegative(), "smallest significant difference");
  table.number("golden_only", p.golden_only, "1", Range::closed(0, 1),
               "1: golden section alone, as the thesis; 0: parabolas too, with fewer moves");
}

void declareCommands(HammerParameters& p, ParameterTable& table) {
  table.section("Completion of a command.");
  table.number("command_delay", p.command_delay, "s", Range::atLeast(BLOCK),
               "from a command until its completion is checked: the controller starts with a delay; longer "
               "than a sample block");
  table.number("settle_time", p.settle_time, "s", Range::atLeast(BLOCK),
               "from standstill to the voltage measurement; longer than a sample block");
  table.number("averaging_time", p.averaging_time, "s", Range::positive(), "of a voltage measurement");
  table.number("angle_tolerance", p.angle_tolerance, "rad", Range::positive(), "of an oriented spindle");
  table.number("zero_speed", p.zero_speed, "rad/s", Range::positive(), "spindle at rest below this");
  table.number("rest_readings", p.rest_readings, "1", Range::atLeast(1),
               "consecutive spindle angles at rest that complete an orientation");
  table.number("position_tolerance", p.position_tolerance, "m", Range::positive(),
               "of an axis at its target; of a small jog a quarter of its distance");
  table.number("orient_timeout", p.orient_timeout, "s", Range::positive(), "of a spindle orientation");
  table.number("motion_timeout", p.motion_timeout, "s", Range::positive(), "of a motion of the axes");
}

void declarePaths(HammerParameters& p, ParameterTable& table) {
  table.section("Paths.");
  table.number("standoff", p.standoff, "m", Range::notNegative(),
               "sideways distance from the station while the tool moves down to it and up from it");
  table.number("retract_height", p.retract_height, "m", Range::positive(),
               "above the station's position, for sideways motion");
  table.number("approach_feed", p.approach_feed, "m/s", Range::positive(), "to the station and from it");
  table.number("jog_feed", p.jog_feed, "m/s", Range::positive(), "of the calibration; thesis: 60 mm/min");
  table.number("near_path", p.near_path, "m", Range::notNegative(),
               "last section of the path to the station, at jog_feed with the sensor's range monitored; at "
               "most standoff");
}

void declareCalibration(HammerParameters& p, ParameterTable& table) {
  table.section("Sensor calibration.");
  table.number("first_jog", p.first_jog, "m", Range::positive(), "at least least_jog");
  table.number("max_jog", p.max_jog, "m", Range::openLow(0.0, 1e-3), "at least first_jog");
  table.number("least_jog", p.least_jog, "m", Range::positive(), "at least 4 x resolution");
  table.number("resolution", p.resolution, "m", Range::positive(), "of a commanded distance");
  table.number("zero_volt", p.zero_volt, "V", Range::positive(),
               "magnitude below which the sensor counts as zeroed");
  table.number("check_jog", p.check_jog, "m", Range::notNegative(),
               "half width of the symmetric sensitivity measurement, at least least_jog; 0: sensitivity of "
               "the last approach jog, as the thesis");
  table.number("position_std", p.position_std, "m", Range::notNegative(),
               "standard deviation of a distance moved");
  table.number("min_gap_share", p.min_gap_share, "1", Range::open(0.0, 1.0),
               "smallest gap to the sensor, over gap_at_zero_volt");
  table.number("sensor_face", p.sensor_face, "m", Range::closed(0.0, 0.1),
               "diameter of the sensor's face, with which the tool must not collide");
  table.number("sensor_electrode", p.sensor_electrode, "m", Range::closed(0.0, 0.1),
               "diameter of the sensor's electrode");
  table.number(
      "curve_error", p.curve_error, "1", Range::closed(0.0, 0.5),
      "possible deviation of the sensor's curve from the nominal one before the calibration; larger: "
      "shorter approaches in front of a flank");
  table.number("curve_jog", p.curve_jog, "m", Range::closed(0.0, 1e-3),
               "distance away from the sensor over which the curvature is measured at the calibration's end; "
               "0: from the approach alone");
  table.number("max_approach", p.max_approach, "m", Range::positive(),
               "longest approach to the sensor, in addition to the depth between two flutes");
}

void declareHitEvaluation(HammerParameters& p, ParameterTable& table) {
  table.number("force_high", p.force_high, "Hz", Range::notNegative(),
               "the force must have power up to here, duller hits are repeated; 0: not checked");
  table.number("asked_std", p.asked_std, "1", Range::notNegative(),
               "relative standard deviation of the FRF over the fit's band that ends the measurement before "
               "the goal's number of hits, after three at least; 0: not used");
  table.number("exponential_time", p.exponential_time, "s", Range::notNegative(),
               "time constant of an exponential window; 0: none");
  table.number("straighten_sensor", p.straighten_sensor, "1", Range::closed(0, 1),
               "1: linearise the vibration by the calibrated curve of the sensor; 0: constant sensitivity");
  table.number("averaged_share", p.averaged_share, "1", Range::closed(0.0, 1.0),
               "share of the sample period over which the converter averages the voltage; 0: it samples");
  table.number("coil_share", p.coil_share, "1", Range::closed(0.0, 0.2),
               "largest solenoid crosstalk that is subtracted, over the peak of the channel; 0: none is");
  table.number("axes_turn_std", p.axes_turn_std, "rad", Range::closed(0.0, 0.5),
               "standard deviation of the angle between the station's axes and those of the structure: modes "
               "across appear by its square");
  table.number("cross_frf", p.cross_frf, "1", Range::closed(0, 1),
               "1: measure the cross FRF where there is a second sensor at right angles (channel gap_cross)");
}

void declareTip(HammerParameters& p, ParameterTable& table) {
  table.section("From the struck height to the tip, where the goal states the stick-out.");
  table.choice("tip_correction", p.tip_correction, {"apart", "eq_4_44"},
               "apart: each mode of spindle and tool by its own shape, the tool a beam; eq_4_44: one factor "
               "for all modes, as the thesis");
  table.number("second_height", p.second_height, "1", Range::closed(0, 1),
               "1: half as many hits with the tool lowered by half the hammer's offset, which determine the "
               "tilt of the spindle modes");
  table.number("read_height", p.read_height, "m", Range::closed(0.0, 0.05),
               "height of the sensor's centre above the tip at the station; the hammer is its offset above "
               "the sensor");
  table.number("height_std", p.height_std, "m", Range::notNegative(), "standard deviation of heights");
  table.number("stickout_std", p.stickout_std, "m", Range::notNegative(),
               "standard deviation of the goal's stick-out");
  table.choice("tool_material", p.tool_material, {"unknown", "carbide", "steel"},
               "of the tool's body; unknown: modes above the band, which the beam predicts, only widen the "
               "standard deviations");
  table.number("tool_fluted_length", p.tool_fluted_length, "m", Range::closed(0.0, 0.5),
               "from the tip, within 1 mm; 0: unknown, about two diameters");
}

}  // namespace

void HammerParameters::declare(ParameterTable& table) {
  declareSearch(*this, table);
  declareCommands(*this, table);
  declarePaths(*this, table);
  declareCalibration(*this, table);
  table.section("Hits.");
  declareHits(table);
  declareHitEvaluation(*this, table);
  declareTip(*this, table);
  table.section("FRF and fit.");
  declareFit(table);
}

void HammerParameters::validate() const {
  checkBounds(*this);
  validateHitTest();
  const auto need = [](bool good, const char* key, double value, const char* expected) {
    if (!good) throw Error(std::string(key) + ": " + shortNumber(value) + ", expected " + expected);
  };
  need(bracket_max_step >= bracket_first_step, "bracket_max_step", bracket_max_step,
       "at least bracket_first_step");
  need(least_jog >= 4.0 * resolution, "least_jog", least_jog, "at least 4 x resolution");
  need(first_jog >= least_jog, "first_jog", first_jog, "at least least_jog");
  need(max_jog >= first_jog, "max_jog", max_jog, "at least first_jog");
  need(near_path <= standoff, "near_path", near_path, "at most standoff");
  need(check_jog == 0.0 || check_jog >= least_jog, "check_jog", check_jog, "0 or at least least_jog");
}

}  // namespace smartmill::hammer
