#include "smartmill_core/require.h"
#include "smartmill_stability/chart/chart.h"

namespace smartmill::stability {
namespace {

void declarePoints(ChartParameters& p, ParameterTable& table) {
  table.section("Points to cut at.");
  table.number("max_depth", p.max_depth, "m", Range::positive(),
               "of the tool; nothing deeper is recommended or proposed");
  table.number("depth_margin", p.depth_margin, "1", Range::openHigh(0.0, 1.0),
               "recommended depths stay this share below the limit");
  table.number("speed_margin", p.speed_margin, "1", Range::openHigh(0.0, 0.2),
               "and below it also for speeds this much off");
  table.number(
      "risk", p.risk, "1", Range::closed(0.0, 0.5),
      "largest probability of chatter of a recommended cut, by the deviations of what was measured, by "
      "zero-order theory and by collocation; needs modes (tool/modes); 0: not asked for");
  table.number("frequency_std", p.frequency_std, "1", Range::openHigh(0.0, 0.2),
               "deviation of a mode's frequency besides its estimate's: a spindle that turns and warms up is "
               "not the one tapped at rest");
  table.number("gain_std", p.gain_std, "1", Range::openHigh(0.0, 0.5),
               "the same of compliance, damping and cutting coefficients");
  table.number("kr_std", p.radial_std, "1", Range::openHigh(0.0, 0.5),
               "deviation of a radial coefficient that was not identified, over its value");
  table.number("load_share", p.load_share, "1", Range::openLow(0.0, 1.0),
               "of the spindle's torque and power that is used");
  table.number("recommended", p.recommended, "1", Range::closed(0, 100), "at most so many, one a pocket");
  table.number("unstable_factor", p.unstable_factor, "1",
               Range::closed(ChartParameters::CLEARLY_UNSTABLE, 5.0),
               "depth over the limit of the points for a check");
  table.number("unstable", p.unstable, "1", Range::closed(0, 100), "at most so many, one a valley");
}

}  // namespace

void ChartParameters::declare(ParameterTable& table) {
  table.section("The cut that the chart is for.");
  table.number("entry_angle", entry, "rad", Range::openHigh(0.0, units::TWO_PI),
               "immersion angle at which a tooth enters, clockwise from +y; x is the feed");
  table.number("exit_angle", exit, "rad", Range::openLow(0.0, units::TWO_PI),
               "above entry_angle; 0 .. pi is a slot");
  table.number("feed_per_tooth", feed_per_tooth, "m", Range::positive(),
               "torque, power and removal rate belong to it");
  table.number("kr", radial_ratio, "1", Range::notNegative(),
               "radial over tangential coefficient where the radial one was not identified");
  table.section("The chart.");
  table.number("speed_low", speed_low, "rad/s", Range::positive(), "lowest");
  table.number("speed_high", speed_high, "rad/s", Range::notNegative(),
               "above speed_low; 0: the spindle's highest speed from the model");
  table.number("speeds", speeds, "1", Range::closed(2, 100000), "evenly from low to high");
  table.number("frequency_low", frequency_low, "Hz", Range::notNegative(),
               "lines of measured FRFs below say little and are left out");
  table.number("frequency_high", frequency_high, "Hz", Range::positive(), "above frequency_low");
  table.number(
      "line_error", line_error, "1", Range::positive(),
      "lines with a standard deviation above this share of the FRF's peak are left out: the hammer's "
      "spectrum has zeros; so are lines below three of their own standard deviations");
  table.choice(
      "method", method, {"zero_order", "collocation", "auto"},
      "zero_order: from the measured FRFs at once; collocation: exact, from the modes (tool/modes), takes "
      "seconds; auto: collocation where modes of x and y are known and fit well");
  table.number("modes_error", modes_error, "1", Range::positive(),
               "relative error of the modes' fit up to which auto trusts them");
  table.flag("use_modes", use_modes,
             "zero_order: true: fitted modes (tool/modes) instead of the measured FRFs (tool/frf)");
  declarePoints(*this, table);
}

void ChartParameters::validate() const {
  checkBounds(*this);
  require(exit > entry, "exit_angle", exit, "above entry_angle");
  require(speed_high == 0.0 || speed_high > speed_low, "speed_high", speed_high, "above speed_low, or 0");
  require(frequency_high > frequency_low, "frequency_high", frequency_high, "above frequency_low");
}

}  // namespace smartmill::stability
