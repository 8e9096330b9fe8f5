#include "smartmill_kalman/compensation/force_model_chooser.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/formatted.h"

namespace smartmill::kalman {

using Speed = ForceModelChoice::Speed;
using Reason = ForceModelChoice::Reason;

ForceModelChooser::ForceModelChooser(const CompensationParameters& parameters)
    : setting_(parameters.track_speed),
      model_(parameters.delay_form ? "delay form" : "harmonics"),
      obstacle_(parameters.delay_form ? "delay_form" : (parameters.follow ? "follow" : "")),
      timeout_(parameters.angle_timeout),
      ripple_(parameters.speed_tolerance) {
}

void ForceModelChooser::handle(const SpindleAngle& angle) {
  if (std::isnan(angle.speed)) return;
  if (angle.stamp - angle_ > timeout_) {
    angles_since_ = angle.stamp;
    ripple_.reset();
  }
  angle_ = angle.stamp;
  ripple_.add(angle);
}

void ForceModelChooser::handle(const CncState& state) {
  if (!state.connected || std::isnan(state.spindle_speed)) return;
  controller_stamp_ = state.stamp;
  controller_ = std::abs(state.spindle_speed);
}

const ForceModelChoice& ForceModelChooser::choose(double stamp) {
  if (stamp - block_ > timeout_) blocks_since_ = stamp;  // a pause of all streams is no missing reading
  block_ = stamp;
  choice_ = {};
  if (setting_.isAlways()) {
    estimate(Reason::parameter, 0.0);
  } else if (setting_.isAuto()) {
    const bool missing = stamp - std::max(angle_, blocks_since_) > timeout_;
    was_missing_ = missing || (was_missing_ && stamp - angles_since_ <= timeout_);
    if (was_missing_) {
      estimate(Reason::no_angle, std::max(0.0, stamp - angle_));
    } else if (ripple_.isRippling()) {
      estimate(Reason::ripple, ripple_.rms());
    }
  }
  return choice_;
}

void ForceModelChooser::estimate(Reason reason, double value) {
  choice_.reason = reason;
  choice_.value = value;
  if (obstacle_.empty() && startSpeed() > 0.0) {
    choice_.speed = Speed::estimated;
  } else if (reason != Reason::ripple) {
    choice_.speed = Speed::unknown;
  }
}

double ForceModelChooser::startSpeed() const {
  if (choice_.reason == Reason::ripple) return ripple_.speed();
  const double controller = controllerSpeed();
  return std::isnan(controller) ? commanded_ : controller;
}

double ForceModelChooser::controllerSpeed() const {
  return block_ - controller_stamp_ <= timeout_ ? controller_ : NOT_A_NUMBER;
}

std::string ForceModelChooser::text() const {
  std::string why;
  switch (choice_.reason) {
    case Reason::none:
      return model_ + " by spindle angle";
    case Reason::parameter:
      why = "track_speed always";
      break;
    case Reason::no_angle:
      why = std::isinf(choice_.value) ? "no spindle angle"
                                      : formatted("no spindle angle for %.1f s", choice_.value);
      break;
    case Reason::ripple:
      why = formatted("speed ripple %.2f %%", 100.0 * choice_.value);
      break;
  }
  if (!obstacle_.empty()) why += "; " + obstacle_ + " excludes an estimate";
  switch (choice_.speed) {
    case Speed::measured:
      return model_ + " by spindle angle (" + why + ")";
    case Speed::estimated:
      return model_ + ", speed estimated (" + why + ")";
    case Speed::unknown:
      break;
  }
  if (obstacle_.empty()) {
    why += std::isnan(controllerSpeed()) ? "; no speed from controller or cutting condition"
                                         : "; spindle at rest by the controller";
  }
  return "none, samples pass through (" + why + ")";
}

void ForceModelChooser::reset() {
  ripple_.reset();
  block_ = blocks_since_ = angle_ = angles_since_ = controller_stamp_ = NEVER;
  was_missing_ = false;
  controller_ = commanded_ = 0.0;
  choice_ = {};
}

}  // namespace smartmill::kalman
