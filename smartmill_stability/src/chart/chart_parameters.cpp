#include "smartmill_stability/chart/chart_parameters.h"

#include "smartmill_core/require.h"
#include "smartmill_stability/chart/surface_error.h"

namespace smartmill::stability {
namespace {

void declarePoints(ChartParameters& p, ParameterTable& table) {
  table.section("Recommended and unstable points.");
  table.number("max_depth", p.max_depth, "m", Range::positive(),
               "largest axial depth of a recommended or proposed point");
  table.number("depth_margin", p.depth_margin, "1", Range::openHigh(0.0, 1.0),
               "relative distance of recommended depths below the limit");
  table.number("speed_margin", p.speed_margin, "1", Range::openHigh(0.0, 0.2),
               "relative error of the speed for which the depth margin holds");
  table.number("risk", p.risk, "1", Range::closed(0.0, 0.5),
               "largest probability of chatter of a recommended cut, from the standard deviations of the "
               "measurements, "
               "by the zero-order solution and by collocation; requires modes (tool/modes); 0: not limited");
  table.number(
      "frequency_std", p.frequency_std, "1", Range::openHigh(0.0, 0.2),
      "relative standard deviation of modal frequencies in addition to that of the estimate: dynamics "
      "at rest differ from those of a rotating, warm spindle");
  table.number("gain_std", p.gain_std, "1", Range::openHigh(0.0, 0.5),
               "the same for compliance, damping and cutting coefficients");
  table.number("kr_std", p.radial_std, "1", Range::openHigh(0.0, 0.5),
               "relative standard deviation of a radial coefficient that was not identified");
  table.number("load_share", p.load_share, "1", Range::openLow(0.0, 1.0),
               "largest fraction of the rated torque and power of the spindle");
  table.number("surface_tolerance", p.surface_tolerance, "m", Range::notNegative(),
               "largest surface location error of a recommended finishing cut on either side, with two "
               "standard deviations; "
               "requires modes, edge coefficients (kte, kre) and one wall (entry_angle 0 or exit_angle pi); "
               "0: not limited");
  table.number("recommended", p.recommended, "1", Range::closed(0, 100),
               "largest number of recommended points, one for each pocket");
  table.number("unstable_factor", p.unstable_factor, "1",
               Range::closed(ChartParameters::CLEARLY_UNSTABLE, 5.0),
               "depth over limit of unstable points, which are proposed for a check");
  table.number("unstable", p.unstable, "1", Range::closed(0, 100),
               "largest number of unstable points, one for each minimum between pockets");
}

}  // namespace

void ChartParameters::declare(ParameterTable& table) {
  table.section("Cut of the chart.");
  table.number("entry_angle", entry, "rad", Range::openHigh(0.0, units::TWO_PI),
               "immersion angle at which a tooth enters, clockwise from +y; the feed is along x");
  table.number("exit_angle", exit, "rad", Range::openLow(0.0, units::TWO_PI),
               "immersion angle at which a tooth leaves, above entry_angle; 0 .. pi is a slot");
  table.number("feed_per_tooth", feed_per_tooth, "m", Range::positive(),
               "feed per tooth, for torque, power and removal rate");
  table.number("kr", radial_ratio, "1", Range::notNegative(),
               "radial over tangential coefficient, used while the radial one is not identified");
  table.section("Chart.");
  table.number("speed_low", speed_low, "rad/s", Range::positive(), "lowest spindle speed");
  table.number("speed_high", speed_high, "rad/s", Range::notNegative(),
               "highest spindle speed, above speed_low; 0: from the model");
  table.number("speeds", speeds, "1", Range::closed(2, 100000), "number of evenly spaced speeds");
  table.number("frequency_low", frequency_low, "Hz", Range::notNegative(),
               "lower end of the band of measured FRFs");
  table.number("frequency_high", frequency_high, "Hz", Range::positive(),
               "upper end of the band, above frequency_low");
  table.number(
      "line_error", line_error, "1", Range::positive(),
      "lines with a standard deviation above this fraction of the peak of the FRF are ignored (zeros of the "
      "hammer's spectrum), as are lines below three of their own standard deviations");
  table.choice("method", method, {"zero_order", "collocation", "auto"},
               "zero_order: from the measured FRFs, mean over the arc; collocation: exact, from the modes "
               "(tool/modes); auto: "
               "collocation where the modes of x and y fit, else zero_order");
  table.number("modes_error", modes_error, "1", Range::positive(),
               "largest relative error of the modal fit for which auto selects collocation");
  table.flag("use_modes", use_modes,
             "zero_order: true: from the fitted modes (tool/modes) instead of the measured FRFs (tool/frf)");
  declarePoints(*this, table);
}

void ChartParameters::validate() const {
  checkBounds(*this);
  require(exit > entry, "exit_angle", exit, "above entry_angle");
  require(speed_high == 0.0 || speed_high > speed_low, "speed_high", speed_high, "above speed_low, or 0");
  if (surface_tolerance > 0.0) requireOneWall(entry, exit);
  require(frequency_high > frequency_low, "frequency_high", frequency_high, "above frequency_low");
}

}  // namespace smartmill::stability
