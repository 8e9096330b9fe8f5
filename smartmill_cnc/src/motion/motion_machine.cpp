#include "smartmill_cnc/motion/motion_machine.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::cnc {
namespace {

constexpr const char* AXES = "XYZ";
constexpr double CLOCK_JUMP = 5.0;  // [s] between two steps: the clock was set, or the computer was suspended

MotionCode codeOf(const Failure& failure, MotionCode otherwise) {
  return failure.kind == Failure::Kind::alarm ? MotionCode::alarm : otherwise;
}

}  // namespace

void MotionParameters::validate() const {
  checkBounds(*this);
  limits.validate();
}

MotionMachine::MotionMachine(Controller& controller, const MotionParameters& parameters, Log& log)
    : controller_(controller), parameters_(parameters), log_(log) {
  parameters_.validate();
}

Status MotionMachine::step(const Reading& reading, double now) {
  followClock(now);
  reading_ = reading;
  now_ = now;
  const Status watched = checkController();
  if (!watched) {
    return watched;
  }
  switch (phase_) {
    case Phase::opening: {
      // Every program starts with 100 %, also directly after another.
      const Status back = resetOverrides();
      return back ? open() : back;
    }
    case Phase::sending:
      return send();
    case Phase::running:
      return run();
    case Phase::stopping:
      endStop();
      return {};
    case Phase::idle:
      return resetOverrides();
  }
  return {};
}

// --- overrides

std::string MotionMachine::overrideFault(const Overrides& wanted) const {
  const MotionLimits& limits = parameters_.limits;
  const auto outside = [](const char* what, double value, double low, double high) {
    const bool within = value >= low && value <= high;
    return within ? std::string()
                  : std::string(what) + " override " + fixedDecimals(100.0 * value, 1) + " %: expected " +
                        fixedDecimals(100.0 * low, 0) + " .. " + fixedDecimals(100.0 * high, 0) + " %";
  };
  std::string fault = outside("feed", wanted.feed, limits.min_feed_override, limits.max_feed_override);
  if (fault.empty()) {
    fault = outside("spindle", wanted.spindle, limits.min_spindle_override, limits.max_spindle_override);
  }
  const double programmed = motion_.condition ? motion_.condition->spindle_speed
                                              : reading_->state.spindle_speed / overrides_.spindle;
  if (fault.empty() && wanted.spindle * programmed > limits.max_spindle_speed) {
    fault = "spindle override " + fixedDecimals(100.0 * wanted.spindle, 1) + " %: above the highest speed, " +
            fixedDecimals(units::rpmFromRadPerSec(limits.max_spindle_speed), 0) + " rpm";
  }
  if (fault.empty() && wanted.feed * reading_->state.feed > overrides_.feed * limits.max_feed) {
    fault = "feed override " + fixedDecimals(100.0 * wanted.feed, 1) + " %: above the highest feed, " +
            fixedDecimals(limits.max_feed / units::MM * 60.0, 0) + " mm/min";
  }
  return fault;
}

Result<OverrideAnswer> MotionMachine::setOverrides(const Overrides& wanted, const std::string& reason) {
  const auto refuse = [](OverrideCode code, const std::string& why) {
    OverrideAnswer answer;
    answer.code = code;
    answer.message = why;
    return answer;
  };
  if (!armed_) {
    return refuse(OverrideCode::not_armed, "overrides: motion is not armed");
  }
  if (phase_ != Phase::sending && phase_ != Phase::running) {
    return refuse(OverrideCode::not_armed, "overrides: no program runs");
  }
  const std::string fault = overrideFault(wanted);
  if (!fault.empty()) {
    return refuse(OverrideCode::limit, fault);
  }
  const Result<Overrides> taken = controller_.setOverrides(wanted);
  if (!taken) {
    if (taken.failure().kind == Failure::Kind::lost) {
      return taken.failure();
    }
    return refuse(OverrideCode::refused, "overrides: " + taken.failure().message);
  }
  overridden_ = true;
  overrides_ = *taken;
  OverrideAnswer answer;
  answer.taken = *taken;
  answer.message = "feed " + fixedDecimals(100.0 * taken->feed, 0) + " %, spindle " +
                   fixedDecimals(100.0 * taken->spindle, 1) + " %";
  log_.info(answer.message + (reason.empty() ? "" : ": " + reason));
  return answer;
}

Status MotionMachine::resetOverrides() {
  if (!std::exchange(overridden_, false)) {
    return {};
  }
  overrides_ = {};
  const Result<Overrides> taken = controller_.setOverrides({});
  if (taken) {
    return {};
  }
  if (taken.failure().kind == Failure::Kind::lost) {
    overridden_ = true;
    return taken.failure();
  }
  log_.warning("overrides are not reset to 100 %: " + taken.failure().message);
  return {};
}

/// Shifts all stored times with a jump of the clock, so that it causes neither a timeout nor a wait.
void MotionMachine::followClock(double now) {
  const double jump = now - now_;
  if (jump >= 0.0 && (jump <= CLOCK_JUMP || !reading_)) {
    return;
  }
  if (busy()) {
    log_.warning("the clock jumped by " + fixedDecimals(jump, 3) + " s during a motion");
  }
  for (double* time : {&entered_, &progressed_, &condition_from_, &condition_to_}) {
    *time += jump;
  }
  if (still_since_) {
    *still_since_ += jump;
  }
}

std::string MotionMachine::lost(const std::string& why, double now) {
  now_ = now;
  reading_.reset();
  armed_ = false;
  if (!busy()) {
    return why;
  }
  const std::string line = motion_.name + ": " + why;
  finish({MotionCode::lost, line});
  return line;
}

// --- arming

Result<Answer<ArmCode>> MotionMachine::arm() {
  const CncState& state = reading_->state;
  if (parameters_.read_only) {
    return Answer<ArmCode>{ArmCode::wrong_mode,
                           "motion is not armed: the bridge only reads (parameter read_only)"};
  }
  if (armed_) {
    return Answer<ArmCode>{ArmCode::ok, "motion is armed already"};
  }
  if (state.emergency || state.alarm) {
    return Answer<ArmCode>{ArmCode::alarm, "motion is not armed: " + alarmText()};
  }
  if (state.mode != CncMode::dnc) {
    return Answer<ArmCode>{ArmCode::wrong_mode, "motion is not armed: " + modeText()};
  }
  const Status opened = controller_.openPrograms();
  if (opened.lost()) {
    return opened.failure();
  }
  if (!opened) {
    const bool alarm = opened.failure().kind == Failure::Kind::alarm;
    return Answer<ArmCode>{alarm ? ArmCode::alarm : ArmCode::wrong_mode,
                           "motion is not armed: " + failureText(opened.failure())};
  }
  setArmed(true);
  // An earlier client may have left overrides.
  overridden_ = controller_.takesOverrides();
  return Answer<ArmCode>{ArmCode::ok, "motion is armed"};
}

Status MotionMachine::disarm() {
  const Status cancelled = cancel();
  setArmed(false);
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

void MotionMachine::setArmed(bool armed) {
  if (armed_ != armed) {
    log_.info(armed ? "motion is armed" : "motion is disarmed");
  }
  armed_ = armed;
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
  if (!reading_ || !controller_.connected()) {
    return refuse(MotionCode::not_connected, "no connection to the " + controller_.name());
  }
  if (busy()) {
    return refuse(MotionCode::busy, motion_.name + " is running");
  }
  if (reading_->state.emergency || reading_->state.alarm) {
    return refuse(MotionCode::alarm, alarmText());
  }
  if (reading_->state.mode != CncMode::dnc) {
    return refuse(MotionCode::wrong_mode, modeText());
  }
  if (!armed_) {
    return refuse(MotionCode::not_armed, "motion is not armed");
  }
  for (int k = 0; k < 3; ++k) {
    if (!axisIndex(k)) {
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
    const std::size_t axis = *axisIndex(static_cast<int>(k));
    from.machine[k] = reading_->state.position[axis];
    from.absolute[k] = reading_->absolute[axis];
  }
  const NcCheck check = checkProgram(program, from, parameters_.limits, controller_.dialect());
  if (check.verdict != NcVerdict::good) {
    const bool limit = check.verdict == NcVerdict::outside_limits;
    return Outcome{limit ? MotionCode::limit : MotionCode::bad_goal, motion.name + ": " + check.message};
  }
  motion.program = check.text;
  motion_ = std::move(motion);
  outcome_.reset();
  enter(Phase::opening);
  return std::nullopt;
}

/// Index of x (0), y (1), z (2) among the controller's axes.
std::optional<std::size_t> MotionMachine::axisIndex(int axis) const {
  if (!reading_) {
    return std::nullopt;
  }
  const std::vector<std::string>& axes = reading_->state.axes;
  const auto found = std::find(axes.begin(), axes.end(), std::string(1, AXES[axis]));
  if (found == axes.end()) {
    return std::nullopt;
  }
  return static_cast<std::size_t>(found - axes.begin());
}

std::string MotionMachine::alarmText() const {
  const CncState& state = reading_->state;
  return (state.emergency ? "emergency stop" : "alarm") +
         (state.alarm_text.empty() ? std::string() : ": " + state.alarm_text);
}

std::string MotionMachine::modeText() const {
  return "the controller is not in DNC mode at its panel (mode " +
         std::to_string(static_cast<int>(reading_->state.mode)) + ")";
}

std::string MotionMachine::failureText(const Failure& failure) const {
  return failure.kind == Failure::Kind::wrong_mode ? modeText() : failure.message;
}

Progress MotionMachine::progress() const {
  Progress p;
  const Transfer transfer = controller_.transfer();
  p.bytes_sent = phase_ == Phase::opening ? 0 : transfer.sent;
  p.bytes_total = phase_ == Phase::opening ? motion_.program.size() : transfer.total;
  constexpr const char* STAGES[] = {"", "opening", "sending", "running", "stopping"};
  p.stage = STAGES[static_cast<std::size_t>(phase_)];
  if (motion_.axis >= 0) {
    if (const std::optional<std::size_t> axis = axisIndex(motion_.axis)) {
      p.distance_to_go = reading_->state.distance_to_go[*axis];
    }
  }
  return p;
}

// --- ending

Status MotionMachine::cancel(const std::string& why) {
  if (phase_ == Phase::opening) {
    finish({MotionCode::cancelled, motion_.name + ": " + why + " before anything was sent"});
    return {};
  }
  if (phase_ == Phase::sending || phase_ == Phase::running) {
    return stop({MotionCode::cancelled, motion_.name + ": " + why});
  }
  return {};
}

/// Ends the motion on an alarm, a change of mode or the end of the DNC session.
Status MotionMachine::checkController() {
  if (!armed_) {
    return {};
  }
  const CncState& state = reading_->state;
  if (state.emergency || state.alarm) {
    return abandonMotion(MotionCode::alarm, alarmText());
  }
  if (state.mode != CncMode::dnc) {
    return abandonMotion(MotionCode::wrong_mode, modeText());
  }
  if (!controller_.programsOpen() || phase_ == Phase::stopping) {
    return {};
  }
  const Status open = controller_.checkPrograms();
  if (open || open.lost()) {
    return open;
  }
  return abandonMotion(codeOf(open.failure(), MotionCode::cancelled), open.failure().message);
}

Status MotionMachine::abandonMotion(MotionCode code, const std::string& why) {
  log_.warning("motion is disarmed: " + why);
  armed_ = false;
  const Status aborted = controller_.programsOpen() ? controller_.abandonPrograms() : Status();
  if (busy() && !aborted.lost()) {
    finish({code, motion_.name + ": " + why});
  }
  return aborted.lost() ? aborted : Status();
}

Status MotionMachine::stop(Outcome outcome) {
  stopping_outcome_ = std::move(outcome);
  const Status aborted = controller_.abort();
  enter(Phase::stopping);
  return aborted.lost() ? aborted : Status();
}

void MotionMachine::endStop() {
  const CncState& state = reading_->state;
  const bool stopped = reading_->at_rest && state.position == last_progress_.position;
  last_progress_.position = state.position;
  if (!stopped && now_ - entered_ <= parameters_.stop_timeout) {
    return;
  }
  Outcome outcome = stopping_outcome_;
  if (!stopped) {
    outcome.message += "; the machine STILL MOVES: use the panel";
  } else {
    outcome.message += "; stopped at";
    for (std::size_t i = 0; i < state.position.size(); ++i) {
      outcome.message +=
          " " + state.axes[i] + fixedDecimals(state.position[i] / units::MM, controller_.dialect().decimals);
    }
    outcome.message += " mm";
  }
  finish(outcome);
}

void MotionMachine::finish(const Outcome& outcome) {
  const bool begun = phase_ == Phase::sending || phase_ == Phase::running || phase_ == Phase::stopping;
  if (motion_.condition && begun) {
    CuttingCondition none;
    none.stamp = std::max(now_, condition_from_ + 1e-3);
    conditions_.push_back(none);
  }
  if (outcome.code != MotionCode::ok && outcome.code != MotionCode::lost) {
    log_.warning(outcome.message);
  }
  outcome_ = outcome;
  enter(Phase::idle);
}

// --- phases

void MotionMachine::enter(Phase phase) {
  phase_ = phase;
  entered_ = now_;
  progressed_ = now_;
  still_since_.reset();
}

Status MotionMachine::open() {
  if (!controller_.programsOpen()) {
    const Status opened = controller_.openPrograms();
    if (opened.lost()) {
      return opened;
    }
    if (!opened) {
      const bool later = opened.failure().kind == Failure::Kind::not_yet;
      if (!later || now_ - entered_ > parameters_.open_timeout) {
        finish({codeOf(opened.failure(), MotionCode::wrong_mode),
                motion_.name + ": " + failureText(opened.failure())});
      }
      return {};
    }
  }
  controller_.begin(motion_.program);
  enter(Phase::sending);
  announceCondition();
  return send();
}

/// Announces the condition in advance, so that every subscriber has it when the motion starts.
void MotionMachine::announceCondition() {
  condition_from_ = condition_to_ = now_;
  if (motion_.condition) {
    condition_from_ += parameters_.condition_lead;
    motion_.condition->stamp = condition_from_;
    conditions_.push_back(*motion_.condition);
  }
}

/// The rest of the text that the controller does not accept yet is sent in the next step.
Status MotionMachine::send() {
  if (now_ < condition_from_) {
    progressed_ = now_;
    return {};
  }
  const std::size_t before = controller_.transfer().sent;
  const Status sent = controller_.send();
  if (sent.lost()) {
    return sent;
  }
  if (!sent) {
    return abandonMotion(codeOf(sent.failure(), MotionCode::cancelled), failureText(sent.failure()));
  }
  const Transfer transfer = controller_.transfer();
  if (transfer.complete) {
    enter(Phase::running);
    return {};
  }
  if (transfer.sent > before) {
    progressed_ = now_;
  }
  return checkStall();
}

bool MotionMachine::ended() const {
  const CncState& state = reading_->state;
  const bool distance_left = std::any_of(state.distance_to_go.begin(), state.distance_to_go.end(),
                                         [](double d) { return d != 0.0; });
  const bool spindle_turns = motion_.orient && std::abs(state.spindle_speed) > parameters_.standstill_speed;
  return reading_->program_done && reading_->at_rest && !distance_left && !spindle_turns;
}

Status MotionMachine::run() {
  if (!ended()) {
    still_since_.reset();
    return checkStall();
  }
  if (!still_since_) {
    still_since_ = now_;
  }
  if (now_ - *still_since_ < parameters_.settle_time) {
    return {};
  }
  if (motion_.condition) {
    // Its end is announced in advance too; the outcome follows after it.
    CuttingCondition none;
    none.stamp = condition_to_ = now_ + parameters_.condition_lead;
    conditions_.push_back(none);
    motion_.condition.reset();
  }
  if (now_ >= condition_to_) {
    finish({MotionCode::ok, motion_.name + ": done"});
  }
  return {};
}

Status MotionMachine::checkStall() {
  const CncState& state = reading_->state;
  if (!reading_->at_rest || state.run == CncRun::hold || state.sequence != last_progress_.sequence ||
      state.spindle_speed != last_progress_.spindle_speed || state.position != last_progress_.position) {
    progressed_ = now_;
  }
  last_progress_ = state;
  if (now_ - progressed_ <= parameters_.stall_timeout) {
    return {};
  }
  return stop({MotionCode::cancelled, motion_.name + ": nothing has moved for " +
                                          fixedDecimals(parameters_.stall_timeout, 0) + " s"});
}

}  // namespace smartmill::cnc
