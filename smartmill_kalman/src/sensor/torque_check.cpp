#include "smartmill_kalman/sensor/torque_check.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/frames.h"
#include "smartmill_core/signal/steady_path.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

constexpr double TIME =
    0.15;  // [s] of a window; two that disagree and one that contains the beginning: 0.45 s
constexpr double REVOLUTIONS = 5.0;       // of a window
constexpr double SETTLING = 4.0;          // [1] time constants of the load meter
constexpr double LATE = 0.2;              // [s] after which a reading of the load meter is not current
constexpr double SPEED_TOLERANCE = 0.02;  // [1]
constexpr double PATH_TOLERANCE = 1e-3;   // [m]
// Torque by the force over that of the load meter: edge forces, and 20 % of error of load meter and friction.
constexpr double LEAST = 0.65, LARGEST = 1.25;
constexpr double IDLE_TOLERANCE = 0.3;  // [1] of the idle torque
constexpr int IN_A_ROW = 2;
constexpr double REPEAT = 5.0;  // [s] between lines about a disagreement that lasts
// Krc / Ktc of metals with edge forces is 0.1 to 0.8.
constexpr double LEAST_RADIAL = -0.2, LARGEST_RADIAL = 1.5;

// An inclined edge has a shorter lever and a radial force that is partly axial; bands have several arcs.
bool isMilledSideways(const CuttingCondition& condition) {
  return condition.tool.teeth > 0 && !condition.tool.edge.inclined() && condition.engagement.bands.empty() &&
         (condition.steady_to[0] != condition.steady_from[0] ||
          condition.steady_to[1] != condition.steady_from[1]);
}

}  // namespace

TorqueCheck::TorqueCheck(const Spindle& spindle)
    : spindle_(spindle), settle_time_(SETTLING / (units::TWO_PI * spindle.load_meter_bandwidth)) {
  if (!spindle.load_meter_full_scale) throw Error("spindle: load_meter_full_scale_v is missing");
}

void TorqueCheck::reset() {
  const auto rotation = rotation_;
  *this = TorqueCheck(spindle_);
  rotation_ = rotation;
}

void TorqueCheck::handle(const CuttingCondition& condition) {
  condition_ = condition;
  on_path_since_ = at_speed_since_ = NEVER;
  window_ = {};
}

void TorqueCheck::handle(const CncState& state) {
  const bool on_path = condition_ && condition_->kind == CuttingCondition::Kind::cut && state.connected &&
                       state.motion && onSteadyPath(*condition_, state, PATH_TOLERANCE);
  if (!on_path) {
    on_path_since_ = NEVER;
    window_ = {};
  } else if (on_path_since_ == NEVER) {
    on_path_since_ = state.stamp;
  }
}

void TorqueCheck::handle(const LoadSample& sample) {
  const bool known = condition_ && condition_->isSteady() && sample.spindle_speed > 0.0;
  if (!known || !(std::abs(sample.spindle_speed - condition_->spindle_speed) <=
                  SPEED_TOLERANCE * condition_->spindle_speed)) {
    at_speed_since_ = NEVER;
    window_ = {};
    return;
  }
  if (at_speed_since_ == NEVER) at_speed_since_ = sample.stamp;
  load_stamp_ = sample.stamp;
  const double torque =
      sample.spindle_load * *spindle_.load_meter_full_scale / spindle_.load_meter_gain / sample.spindle_speed;
  if (!std::isfinite(torque)) return;
  if (condition_->kind == CuttingCondition::Kind::air) {
    if (sample.stamp < at_speed_since_ + settle_time_) return;
    const double model = spindle_.friction().at(sample.spindle_speed);
    measured_idle_ += torque * model;
    modelled_idle_ += model * model;
  } else if (isSteadyAt(sample.stamp)) {
    window_.torque += torque;
    ++window_.readings;
  }
}

bool TorqueCheck::isSteadyAt(double stamp) const {
  return on_path_since_ != NEVER && at_speed_since_ != NEVER && stamp < load_stamp_ + LATE &&
         stamp >= std::max(on_path_since_, at_speed_since_) + settle_time_;
}

// Friction of the model, scaled by the readings in air.
double TorqueCheck::idleTorque() const {
  const double model = spindle_.friction().at(condition_->spindle_speed);
  return modelled_idle_ > 0.0 ? model * measured_idle_ / modelled_idle_ : model;
}

void TorqueCheck::handle(const ForceBlock& measured, const std::array<double, 3>& zero) {
  if (!rotation_ || !isSteadyAt(measured.stamp) || !isMilledSideways(*condition_)) {
    window_ = {};
    return;
  }
  if (window_.begin == NEVER) {
    window_ = {};
    window_.begin = measured.stamp;
  }
  for (std::size_t i = 0; i < measured.force[0].size(); ++i) {
    const std::array<double, 3> force{
        {measured.force[0][i] - zero[0], measured.force[1][i] - zero[1], measured.force[2][i] - zero[2]}};
    if (!std::isfinite(force[0] + force[1] + force[2])) {
      ++window_.missing;
      continue;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) window_.force[axis] += force[axis];
    ++window_.samples;
  }
  const double end = measured.stamp + static_cast<double>(measured.force[0].size()) / measured.sample_rate;
  if (end - window_.begin < std::max(TIME, REVOLUTIONS * units::TWO_PI / condition_->spindle_speed) ||
      window_.readings == 0)
    return;
  compare(end);
  window_ = {};
}

// Torque by the tangential part of a mean force on the tool in the sensor's frame, and by the radial part as
// if it were tangential.
std::array<double, 2> TorqueCheck::torquesOf(const std::array<double, 3>& sensor_force) const {
  const std::array<double, 3> force = frames::rotate(*rotation_, sensor_force);
  const double x = condition_->steady_to[0] - condition_->steady_from[0],
               y = condition_->steady_to[1] - condition_->steady_from[1], length = std::hypot(x, y);
  const double fx = (x * force[0] + y * force[1]) / length, fy = (x * force[1] - y * force[0]) / length;
  const double entry = condition_->engagement.entry, exit = condition_->engagement.exit;
  const double a = 0.5 * (std::pow(std::sin(exit), 2) - std::pow(std::sin(entry), 2)),
               b = 0.5 * (exit - entry) - 0.25 * (std::sin(2.0 * exit) - std::sin(2.0 * entry)),
               s = std::cos(entry) - std::cos(exit);
  const double factor = condition_->tool.radius() * s / (a * a + b * b);
  return {{factor * (b * fy - a * fx), -factor * (a * fy + b * fx)}};
}

bool TorqueCheck::agrees(const std::array<double, 3>& sensor_force, double torque) const {
  const double margin = IDLE_TOLERANCE * std::abs(idleTorque());
  const auto [tangential, radial] = torquesOf(sensor_force);
  return tangential >= LEAST * torque - margin && tangential <= LARGEST * torque + margin &&
         radial >= LEAST_RADIAL * tangential - margin && radial <= LARGEST_RADIAL * tangential + margin;
}

// @return what would explain the disagreement
const char* TorqueCheck::explanation(const std::array<double, 3>& f, double torque) const {
  if (agrees({{-f[0], -f[1], -f[2]}}, torque)) return "wrong sign";
  if (agrees({{f[1], f[0], f[2]}}, torque)) return "channels exchanged";
  if (agrees({{-f[0], f[1], f[2]}}, torque)) return "wrong sign of fx";
  if (agrees({{f[0], -f[1], f[2]}}, torque)) return "wrong sign of fy";
  return "wrong scale of the forces or of the load meter";
}

void TorqueCheck::compare(double stamp) {
  if (window_.missing > window_.samples) return;
  std::array<double, 3> force = window_.force;
  for (double& f : force) f /= static_cast<double>(window_.samples);
  const double torque = window_.torque / static_cast<double>(window_.readings) - idleTorque();
  const double by_force = torquesOf(force)[0];
  ratio_ = by_force / torque;
  if (agrees(force, torque)) {
    disagreements_ = 0;
    disagrees_ = false;
    return;
  }
  if (++disagreements_ < IN_A_ROW) return;
  const bool begins = !std::exchange(disagrees_, true);
  if (!begins && stamp - announced_ < REPEAT) return;
  announced_ = stamp;
  line_ = formatted(
      "channels fx, fy: mean force of a torque of %.3f N m, the load meter measures %.3f N m: %s at %.3f s",
      by_force, torque, explanation(force, torque), stamp);
}

}  // namespace smartmill::kalman
