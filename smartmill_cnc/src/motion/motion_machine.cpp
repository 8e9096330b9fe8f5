#include "smartmill_cnc/motion/motion_machine.h"

#include <cmath>
#include <utility>

#include "smartmill_cnc/motion/nc_program.h"
#include "smartmill_core/units.h"

namespace smartmill::cnc {
namespace {

using Phase = MotionExecutor::Phase;

constexpr const char* AXES = "XYZ";

}  // namespace

MotionCode codeOf(const Failure& failure, MotionCode otherwise) {
  return failure.kind == Failure::Kind::alarm ? MotionCode::alarm : otherwise;
}

void MotionParameters::validate() const {
  checkBounds(*this);
  limits.validate();
}

MotionMachine::MotionMachine(Controller& controller, const MotionParameters& parameters, Log& log)
    : controller_(controller),
      parameters_(parameters),
      log_(log),
      overrides_(controller, parameters_.limits, observation_, log),
      conditions_(parameters_.condition_lead),
      executor_(controller, parameters_, observation_, conditions_, log) {
  parameters_.validate();
}

Status MotionMachine::step(const Reading& reading, double now) {
  if (const double jump = observation_.clockJump(now, parameters_.longest_step); jump != 0.0) {
    if (busy()) {
      log_.warning("the clock jumped by " + fixedDecimals(jump, 3) + " s during a motion");
    }
    // So that the jump causes neither a timeout nor a wait.
    executor_.shift(jump);
    conditions_.shift(jump);
  }
  observation_ = {reading, now};
  const Status watched = checkController();
  if (!watched) {
    return watched;
  }
  if (!busy() || executor_.phase() == Phase::opening) {
    // Every program starts with 100 %, also directly after another.
    const Status back = overrides_.reset();
    if (!back) {
      return back;
    }
  }
  const Status advanced = executor_.step();
  if (advanced || advanced.lost()) {
    return advanced;
  }
  return abandon(codeOf(advanced.failure(), MotionCode::cancelled), observation_.textOf(advanced.failure()));
}

std::string MotionMachine::lost(const std::string& why, double now) {
  observation_ = {std::nullopt, now};
  armed_ = false;
  if (!busy()) {
    return why;
  }
  executor_.finish(MotionCode::lost, why);
  return executor_.name() + ": " + why;
}

/// Ends the motion on an alarm, a change of mode or the end of the DNC session.
Status MotionMachine::checkController() {
  if (!armed_) {
    return {};
  }
  const CncState& state = observation_.state();
  if (state.emergency || state.alarm) {
    return abandon(MotionCode::alarm, observation_.alarmText());
  }
  if (state.mode != CncMode::dnc) {
    return abandon(MotionCode::wrong_mode, observation_.modeText());
  }
  if (!controller_.programsOpen() || executor_.phase() == Phase::stopping) {
    return {};
  }
  const Status open = controller_.checkPrograms();
  if (open || open.lost()) {
    return open;
  }
  return abandon(codeOf(open.failure(), MotionCode::cancelled), open.failure().message);
}

Status MotionMachine::abandon(MotionCode code, const std::string& why) {
  log_.warning("motion is disarmed: " + why);
  armed_ = false;
  const Status aborted = controller_.programsOpen() ? controller_.abandonPrograms() : Status();
  if (aborted.lost()) {
    return aborted;
  }
  if (busy()) {
    executor_.finish(code, why);
  }
  return {};
}

// --- arming

Result<Answer<ArmCode>> MotionMachine::arm() {
  const auto refuse = [](ArmCode code, const std::string& why) {
    return Answer<ArmCode>{code, "motion is not armed: " + why};
  };
  if (parameters_.read_only) {
    return refuse(ArmCode::wrong_mode, "the bridge only reads (parameter read_only)");
  }
  if (armed_) {
    return Answer<ArmCode>{ArmCode::ok, "motion is armed already"};
  }
  const CncState& state = observation_.state();
  if (state.emergency || state.alarm) {
    return refuse(ArmCode::alarm, observation_.alarmText());
  }
  if (state.mode != CncMode::dnc) {
    return refuse(ArmCode::wrong_mode, observation_.modeText());
  }
  const Status opened = controller_.openPrograms();
  if (opened.lost()) {
    return opened.failure();
  }
  if (!opened) {
    const bool alarm = opened.failure().kind == Failure::Kind::alarm;
    return refuse(alarm ? ArmCode::alarm : ArmCode::wrong_mode, observation_.textOf(opened.failure()));
  }
  armed_ = true;
  overrides_.assumeChanged();
  log_.info("motion is armed");
  return Answer<ArmCode>{ArmCode::ok, "motion is armed"};
}

Status MotionMachine::disarm() {
  const Status cancelled = cancel();
  if (std::exchange(armed_, false)) {
    log_.info("motion is disarmed");
  }
  if (cancelled.lost() || !controller_.programsOpen()) {
    return cancelled;
  }
  const Status closed = controller_.closePrograms();
  if (!closed && !closed.lost()) {
    // The controller has already ended the session.
    log_.info("end of the DNC session: " + closed.failure().message);
    return {};
  }
  return closed;
}

// --- starting

std::optional<Outcome> MotionMachine::runProgram(const std::string& name, const std::string& program,
                                                 const CuttingCondition& condition) {
  Motion motion;
  motion.name = "program " + (name.empty() ? "without name" : name);
  if (condition.kind != CuttingCondition::Kind::none) {
    motion.condition = condition;
  }
  return start(std::move(motion), program);
}

std::optional<Outcome> MotionMachine::jog(const std::string& axis, double distance, double feed) {
  Motion motion;
  motion.name = "jog " + axis;
  for (int k = 0; k < 3; ++k) {
    if (axis.size() == 1 && (axis[0] == AXES[k] || axis[0] == AXES[k] - 'A' + 'a')) {
      motion.axis = k;
    }
  }
  if (motion.axis < 0) {
    return Outcome{MotionCode::bad_goal, "jog: axis '" + axis + "', expected x, y or z"};
  }
  if (!std::isfinite(distance) || !std::isfinite(feed) || feed < 0.0) {
    return Outcome{MotionCode::bad_goal,
                   "jog " + axis + ": expected a finite distance and a feed of 0 or more"};
  }
  if (std::abs(distance) > parameters_.limits.max_jog) {
    return Outcome{MotionCode::limit, "jog " + axis + ": " + fixedDecimals(distance / units::MM, 3) +
                                          " mm, at most " +
                                          fixedDecimals(parameters_.limits.max_jog / units::MM, 3) + " mm"};
  }
  const int decimals = controller_.dialect().decimals;
  return start(motion, jogProgram(motion.axis, distance, feed, decimals));
}

std::optional<Outcome> MotionMachine::orient(double angle) {
  if (!std::isfinite(angle)) {
    return Outcome{MotionCode::bad_goal, "orient spindle: the angle is not a finite number"};
  }
  Motion motion;
  motion.name = "orient spindle";
  motion.orient = true;
  return start(motion, controller_.orientProgram(angle));
}

std::optional<Outcome> MotionMachine::refusal(const std::string& name) const {
  const auto refuse = [&](MotionCode code, const std::string& why) {
    return Outcome{code, name + ": " + why};
  };
  if (!observation_.reading || !controller_.connected()) {
    return refuse(MotionCode::not_connected, "no connection to the " + controller_.name());
  }
  if (busy()) {
    return refuse(MotionCode::busy, executor_.name() + " is running");
  }
  const CncState& state = observation_.state();
  if (state.emergency || state.alarm) {
    return refuse(MotionCode::alarm, observation_.alarmText());
  }
  if (state.mode != CncMode::dnc) {
    return refuse(MotionCode::wrong_mode, observation_.modeText());
  }
  if (!armed_) {
    return refuse(MotionCode::not_armed, "motion is not armed");
  }
  for (int k = 0; k < 3; ++k) {
    if (!observation_.axisIndex(k)) {
      return refuse(MotionCode::bad_goal, std::string("the controller has no axis ") + AXES[k]);
    }
  }
  return std::nullopt;
}

std::optional<Outcome> MotionMachine::start(Motion motion, const std::string& program) {
  if (const std::optional<Outcome> refused = refusal(motion.name)) {
    return refused;
  }
  StartPosition from;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t axis = *observation_.axisIndex(static_cast<int>(k));
    from.machine[k] = observation_.state().position[axis];
    from.absolute[k] = observation_.reading->absolute[axis];
  }
  const NcCheck check = checkProgram(program, from, parameters_.limits, controller_.dialect());
  if (check.verdict != NcVerdict::good) {
    const bool limit = check.verdict == NcVerdict::outside_limits;
    return Outcome{limit ? MotionCode::limit : MotionCode::bad_goal, motion.name + ": " + check.message};
  }
  motion.program = check.text;
  executor_.start(std::move(motion));
  return std::nullopt;
}

// --- overrides

Result<OverrideAnswer> MotionMachine::setOverrides(const Overrides& wanted, const std::string& reason) {
  const bool runs = executor_.phase() == Phase::sending || executor_.phase() == Phase::running;
  if (!armed_ || !runs) {
    OverrideAnswer answer;
    answer.code = OverrideCode::not_armed;
    answer.message = armed_ ? "overrides: no program runs" : "overrides: motion is not armed";
    return answer;
  }
  const std::optional<CuttingCondition>& condition = conditions_.running();
  return overrides_.set(wanted, condition ? std::optional<double>(condition->spindle_speed) : std::nullopt,
                        reason);
}

}  // namespace smartmill::cnc
