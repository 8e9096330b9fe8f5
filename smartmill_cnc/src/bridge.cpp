#include "smartmill_cnc/bridge.h"

#include <cmath>
#include <utility>

#include "smartmill_core/error.h"

namespace smartmill::cnc {
namespace {

double checkedPeriod(double period) {
  if (!(period > 0.0) || !std::isfinite(period)) {
    throw Error("reconnect_period: " + fixedDecimals(period, 3) + ", expected a finite period above 0");
  }
  return period;
}

}  // namespace

Bridge::Bridge(std::unique_ptr<Controller> controller, double reconnect_period,
               const MotionParameters& motion)
    : controller_(std::move(controller)),
      poller_(*controller_, {checkedPeriod(reconnect_period)}, log_),
      motion_(*controller_, motion, log_) {
}

Bridge::~Bridge() {
  shutdown();
}

void Bridge::fetch(double now) {
  poller_.fetch(now);
  fetchTemperature(now);
}

void Bridge::fetchTemperature(double now) {
  temperature_.reset();
  const double period = controller_->temperaturePeriod();
  if (!controller_->connected()) {
    temperature_offered_ = true;  // the next connection may be to another controller
    next_temperature_ = now;
    return;
  }
  // A clock that jumps back must not delay the next reading.
  const bool due = now >= next_temperature_ || now < next_temperature_ - period;
  if (period == 0.0 || !temperature_offered_ || !due) {
    return;
  }
  next_temperature_ = now + period;
  std::string refused;
  const Result<MachineTemperature> read = controller_->readTemperature(refused);
  if (read) {
    temperature_ = *read;
  } else if (read.failure().kind == Failure::Kind::lost) {
    return poller_.setError(read.failure().message);
  } else {
    temperature_offered_ = false;
    refused = read.failure().message;
  }
  if (!refused.empty() && refused != temperature_refused_) {
    log_.warning((temperature_offered_ ? "machine/temperature is incomplete: " : "no machine/temperature: ") +
                 refused);
    temperature_refused_ = refused;
  }
}

void Bridge::step(double now) {
  load_.reset();
  if (const std::optional<Reading> reading = poller_.takeReading()) {
    state_ = reading->state;
    state_.connected = true;
    load_ = reading->load;
    alarms_ = reading->alarms;
    noteLoss(motion_.step(*reading, now));
  }
  if (!controller_->connected()) {
    endWithoutConnection(now);
  }
  state_.stamp = now;
  state_.armed = motion_.armed();
  if (!state_.armed) {
    holder_.reset();
  }
  if (load_) {
    load_->stamp = now;
  }
  if (temperature_) {
    temperature_->stamp = now;
  }
}

void Bridge::endWithoutConnection(double now) {
  state_.connected = false;
  poller_.setError(motion_.lost(poller_.lastError(), now));
  poller_.reportDisconnected();
}

void Bridge::noteLoss(const Status& status) {
  if (status.lost()) {
    poller_.setError(status.failure().message);
  }
}

Answer<ArmCode> Bridge::arm(bool on, const std::string& client) {
  if (!on) {
    noteLoss(motion_.disarm());
    state_.armed = false;
    holder_.reset();
    return {ArmCode::ok, "motion is disarmed"};
  }
  if (!state_.connected || !controller_->connected()) {
    return {ArmCode::not_connected, "no connection to the " + controller_->name()};
  }
  if (const std::string refusal = armRefusal(holder_, client); !refusal.empty()) {
    return {ArmCode::held, refusal};
  }
  const Result<Answer<ArmCode>> answer = motion_.arm();
  state_.armed = motion_.armed();
  if (state_.armed && !holder_) {
    holder_ = ArmHolder{client, state_.stamp};
  }
  if (answer) {
    return *answer;
  }
  noteLoss(answer.failure());
  return {ArmCode::not_connected, "motion is not armed: " + answer.failure().message};
}

OverrideAnswer Bridge::setOverrides(const Overrides& wanted, const std::string& reason) {
  OverrideAnswer answer;
  answer.code = OverrideCode::not_connected;
  answer.message = "no connection to the " + controller_->name();
  if (!controller_->connected() || !state_.connected) {
    return answer;
  }
  const Result<OverrideAnswer> result = motion_.setOverrides(wanted, reason);
  if (result) {
    return *result;
  }
  noteLoss(result.failure());
  answer.message = result.failure().message;
  return answer;
}

Answer<HoldCode> Bridge::hold() {
  if (!controller_->connected()) {
    return {HoldCode::not_connected, "no connection to the " + controller_->name()};
  }
  if (!motion_.armed()) {
    return {HoldCode::not_armed, "motion is not armed: use the machine's own feed hold"};
  }
  const Status held = controller_->hold();
  noteLoss(held);
  if (held) {
    return {HoldCode::ok, "feed hold: the axes are stopped; release it at the machine's own key"};
  }
  return {held.lost() ? HoldCode::not_connected : HoldCode::refused, held.failure().message};
}

Answer<MacroCode> Bridge::setMacro(int number, double value) {
  if (!controller_->connected()) {
    return {MacroCode::not_connected, "no connection to the " + controller_->name()};
  }
  const std::string name = "#" + std::to_string(number);
  if (motion_.readOnly()) {
    return {MacroCode::refused, name + ": the bridge only reads (parameter read_only)"};
  }
  if (!std::isfinite(value)) {
    return {MacroCode::refused, name + ": the value is not a finite number"};
  }
  const Status written = controller_->setVariable(number, value);
  noteLoss(written);
  if (written) {
    return {MacroCode::ok, name + " is set"};
  }
  return {written.lost() ? MacroCode::not_connected : MacroCode::refused, written.failure().message};
}

void Bridge::cancel() {
  noteLoss(motion_.cancel());
}

void Bridge::shutdown() {
  if (!controller_->connected()) {
    return;
  }
  noteLoss(motion_.cancel("the bridge ends"));
  noteLoss(motion_.disarm());
  if (controller_->connected()) {
    controller_->close();
  }
  state_.connected = false;
}

}  // namespace smartmill::cnc
