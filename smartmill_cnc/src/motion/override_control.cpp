#include "smartmill_cnc/motion/override_control.h"

#include <utility>

#include "smartmill_cnc/motion/nc_program.h"
#include "smartmill_core/units.h"

namespace smartmill::cnc {
namespace {

OverrideAnswer refusal(OverrideCode code, const std::string& why) {
  OverrideAnswer answer;
  answer.code = code;
  answer.message = why;
  return answer;
}

std::string outside(const char* what, double value, double low, double high) {
  const bool within = value >= low && value <= high;
  return within ? std::string()
                : std::string(what) + " override " + fixedDecimals(100.0 * value, 1) + " %: expected " +
                      fixedDecimals(100.0 * low, 0) + " .. " + fixedDecimals(100.0 * high, 0) + " %";
}

}  // namespace

OverrideControl::OverrideControl(Controller& controller, const MotionLimits& limits,
                                 const Observation& observation, Log& log)
    : controller_(controller), limits_(limits), observation_(observation), log_(log) {
}

std::string OverrideControl::fault(const Overrides& wanted, std::optional<double> programmed) const {
  std::string fault = outside("feed", wanted.feed, limits_.min_feed_override, limits_.max_feed_override);
  if (fault.empty()) {
    fault = outside("spindle", wanted.spindle, limits_.min_spindle_override, limits_.max_spindle_override);
  }
  const CncState& state = observation_.state();
  const double speed = programmed ? *programmed : state.spindle_speed / accepted_.spindle;
  if (fault.empty() && wanted.spindle * speed > limits_.max_spindle_speed) {
    fault = "spindle override " + fixedDecimals(100.0 * wanted.spindle, 1) + " %: above the highest speed, " +
            fixedDecimals(units::rpmFromRadPerSec(limits_.max_spindle_speed), 0) + " rpm";
  }
  if (fault.empty() && wanted.feed * state.feed > accepted_.feed * limits_.max_feed) {
    fault = "feed override " + fixedDecimals(100.0 * wanted.feed, 1) + " %: above the highest feed, " +
            fixedDecimals(limits_.max_feed / units::MM * 60.0, 0) + " mm/min";
  }
  return fault;
}

Result<OverrideAnswer> OverrideControl::set(const Overrides& wanted, std::optional<double> programmed,
                                            const std::string& reason) {
  const std::string refused = fault(wanted, programmed);
  if (!refused.empty()) {
    return refusal(OverrideCode::limit, refused);
  }
  const Result<Overrides> taken = controller_.setOverrides(wanted);
  if (!taken) {
    if (taken.failure().kind == Failure::Kind::lost) {
      return taken.failure();
    }
    return refusal(OverrideCode::refused, "overrides: " + taken.failure().message);
  }
  changed_ = true;
  accepted_ = *taken;
  OverrideAnswer answer;
  answer.taken = *taken;
  answer.message = "feed " + fixedDecimals(100.0 * taken->feed, 0) + " %, spindle " +
                   fixedDecimals(100.0 * taken->spindle, 1) + " %";
  log_.info(answer.message + (reason.empty() ? "" : ": " + reason));
  return answer;
}

Status OverrideControl::reset() {
  if (!std::exchange(changed_, false)) {
    return {};
  }
  accepted_ = {};
  const Result<Overrides> taken = controller_.setOverrides({});
  if (taken) {
    return {};
  }
  if (taken.failure().kind == Failure::Kind::lost) {
    changed_ = true;
    return taken.failure();
  }
  log_.warning("overrides are not reset to 100 %: " + taken.failure().message);
  return {};
}

}  // namespace smartmill::cnc
