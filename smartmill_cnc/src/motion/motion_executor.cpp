#include "smartmill_cnc/motion/motion_executor.h"

#include <algorithm>
#include <cmath>

#include "smartmill_cnc/motion/nc_program.h"
#include "smartmill_core/units.h"

namespace smartmill::cnc {

MotionExecutor::MotionExecutor(Controller& controller, const MotionParameters& parameters,
                               const Observation& observation, ConditionSchedule& conditions, Log& log)
    : controller_(controller),
      parameters_(parameters),
      observation_(observation),
      conditions_(conditions),
      log_(log) {
}

void MotionExecutor::start(Motion motion) {
  motion_ = std::move(motion);
  outcome_.reset();
  enter(Phase::opening);
}

Status MotionExecutor::step() {
  switch (phase_) {
    case Phase::opening:
      return open();
    case Phase::sending:
      return send();
    case Phase::running:
      return run();
    case Phase::stopping:
      endStop();
      return {};
    case Phase::idle:
      return {};
  }
  return {};
}

Progress MotionExecutor::progress() const {
  Progress p;
  const Transfer transfer = controller_.transfer();
  p.bytes_sent = phase_ == Phase::opening ? 0 : transfer.sent;
  p.bytes_total = phase_ == Phase::opening ? motion_.program.size() : transfer.total;
  constexpr const char* STAGES[] = {"", "opening", "sending", "running", "stopping"};
  p.stage = STAGES[static_cast<std::size_t>(phase_)];
  if (motion_.axis >= 0) {
    if (const std::optional<std::size_t> axis = observation_.axisIndex(motion_.axis)) {
      p.distance_to_go = observation_.state().distance_to_go[*axis];
    }
  }
  return p;
}

void MotionExecutor::shift(double jump) {
  entered_ += jump;
  watch_.shift(jump);
}

void MotionExecutor::enter(Phase phase) {
  phase_ = phase;
  entered_ = observation_.now;
  watch_.restart(observation_.now);
}

// --- phases

Status MotionExecutor::open() {
  if (!controller_.programsOpen()) {
    const Status opened = controller_.openPrograms();
    if (opened.lost()) {
      return opened;
    }
    if (!opened) {
      const bool later = opened.failure().kind == Failure::Kind::not_yet;
      if (!later || observation_.now - entered_ > parameters_.open_timeout) {
        finish(codeOf(opened.failure(), MotionCode::wrong_mode), observation_.textOf(opened.failure()));
      }
      return {};
    }
  }
  controller_.begin(motion_.program);
  enter(Phase::sending);
  conditions_.announce(motion_.condition, observation_.now);
  return send();
}

/// The rest of the text that the controller does not accept yet is sent in the next step.
Status MotionExecutor::send() {
  if (!conditions_.hasBegun(observation_.now)) {
    watch_.noteProgress(observation_.now);
    return {};
  }
  const std::size_t before = controller_.transfer().sent;
  const Status sent = controller_.send();
  if (!sent) {
    return sent;
  }
  const Transfer transfer = controller_.transfer();
  if (transfer.complete) {
    enter(Phase::running);
    return {};
  }
  if (transfer.sent > before) {
    watch_.noteProgress(observation_.now);
  }
  return checkStall();
}

Status MotionExecutor::run() {
  const bool has_ended = ended();
  const bool settled = watch_.isSettled(has_ended, observation_.now, parameters_.settle_time);
  if (!has_ended) {
    return checkStall();
  }
  if (settled) {
    // The end of the condition is announced in advance too; the outcome follows after it.
    conditions_.announceEnd(observation_.now);
    if (conditions_.hasEnded(observation_.now)) {
      finish(MotionCode::ok, "done");
    }
  }
  return {};
}

bool MotionExecutor::ended() const {
  const CncState& state = observation_.state();
  const bool distance_left = std::any_of(state.distance_to_go.begin(), state.distance_to_go.end(),
                                         [](double d) { return d != 0.0; });
  const bool spindle_turns = motion_.orient && std::abs(state.spindle_speed) > parameters_.standstill_speed;
  return observation_.reading->program_done && observation_.reading->at_rest && !distance_left &&
         !spindle_turns;
}

Status MotionExecutor::checkStall() {
  if (!watch_.isStalled(*observation_.reading, observation_.now, parameters_.stall_timeout)) {
    return {};
  }
  return stop("nothing has moved for " + fixedDecimals(parameters_.stall_timeout, 0) + " s");
}

// --- ending

Status MotionExecutor::cancel(const std::string& why) {
  if (phase_ == Phase::opening) {
    finish(MotionCode::cancelled, why + " before anything was sent");
    return {};
  }
  if (phase_ == Phase::sending || phase_ == Phase::running) {
    return stop(why);
  }
  return {};
}

Status MotionExecutor::stop(const std::string& why) {
  stop_reason_ = why;
  const Status aborted = controller_.abort();
  enter(Phase::stopping);
  return aborted.lost() ? aborted : Status();
}

void MotionExecutor::endStop() {
  const CncState& state = observation_.state();
  const bool stopped = watch_.restsAt(*observation_.reading);
  if (!stopped && observation_.now - entered_ <= parameters_.stop_timeout) {
    return;
  }
  std::string message = stop_reason_;
  if (!stopped) {
    message += "; the machine STILL MOVES: use the panel";
  } else {
    message += "; stopped at";
    for (std::size_t i = 0; i < state.position.size(); ++i) {
      message +=
          " " + state.axes[i] + fixedDecimals(state.position[i] / units::MM, controller_.dialect().decimals);
    }
    message += " mm";
  }
  finish(MotionCode::cancelled, message);
}

void MotionExecutor::finish(MotionCode code, const std::string& message) {
  conditions_.breakOff(observation_.now);
  outcome_ = Outcome{code, motion_.name + ": " + message};
  if (code != MotionCode::ok && code != MotionCode::lost) {
    log_.warning(outcome_->message);
  }
  enter(Phase::idle);
}

}  // namespace smartmill::cnc
