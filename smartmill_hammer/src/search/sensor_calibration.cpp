#include "smartmill_hammer/search/sensor_calibration.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"

namespace smartmill::hammer {

SensorCalibration::SensorCalibration(const SensorCalibrationOptions& options)
    : options_(options), samples_(options) {
  const auto& o = options_;
  if (!(o.least_jog > 0.0 && o.first_jog >= o.least_jog && o.max_jog >= o.first_jog)) {
    throw Error("sensor calibration: expected 0 < least_jog <= first_jog <= max_jog, got " +
                std::to_string(o.least_jog * 1e6) + ", " + std::to_string(o.first_jog * 1e6) + ", " +
                std::to_string(o.max_jog * 1e6) + " um");
  }
}

void SensorCalibration::start(double volt, double volt_std) {
  volt_ = volt;
  volt_std_ = volt_std;
  samples_.add(0.0, volt);
  // A short safe travel may result from the uncertain curve alone: determine it by samples further away.
  if (!samples_.isClipped(volt) && volt < -options_.zero_volt && options_.curve_jog > 0.0 &&
      options_.safe_travel < static_cast<double>(options_.least_readings) * options_.max_jog) {
    samples_away_ = options_.least_readings - 1;
    return moveAway();
  }
  if (samples_.isClipped(volt)) {
    requestJog(volt < 0.0 ? options_.max_jog : -options_.max_jog);
  } else {
    // At zero already: the sensitivity requires a jog, away from the sensor.
    requestJog(volt < -options_.zero_volt ? options_.first_jog : -options_.first_jog);
  }
}

void SensorCalibration::requestJog(double distance) {
  const double rounded = std::round(distance / options_.resolution) * options_.resolution;
  if (jogs_ >= options_.max_jogs) {
    return fail("the sensor's voltage is not zero after " + std::to_string(jogs_) + " jogs");
  }
  const double safe =
      std::min(options_.safe_travel, travelled_ + samples_.localGap() - options_.min_gap - options_.swing);
  if (phase_ == Phase::approach && rounded > 0.0 && travelled_ + rounded > safe - options_.check_jog) {
    const double left = safe - options_.check_jog - travelled_;
    const double step = std::floor(left / options_.resolution) * options_.resolution;
    if (step >= options_.least_jog) {
      next_jog_ = step;
      return;
    }
    result_.limited_by_edges = true;
    if (result_.sensitivity > 0.0) return startCheck();
    // No approach possible: the sensitivity requires a jog, away from the sensor.
    if (samples_.size() == 1 && !samples_.isClipped(volt_)) {
      next_jog_ = -options_.first_jog;
      return;
    }
    return fail(formatted(
        "the sensor is still out of range (%.2f V) where the tool's edges may touch it, %.2f mm nearer",
        volt_, 1e3 * travelled_));
  }
  if (travelled_ + rounded > options_.max_travel) {
    return fail(formatted("the tool is still out of the sensor's range %.2f mm nearer (%.2f V)",
                          1e3 * travelled_, volt_));
  }
  // By the nominal curve; out of range the gap is at least that at the end of the range.
  if (rounded > 0.0 && samples_.nominalGap(volt_) - rounded < options_.min_gap) {
    return fail(formatted("a jog of %.0f um at %.2f V would bring the tool nearer than %.0f um",
                          1e6 * rounded, volt_, 1e6 * options_.min_gap));
  }
  next_jog_ = rounded;
}

void SensorCalibration::addVoltage(double volt, double volt_std) {
  if (state_ != State::jogging) return;
  ++jogs_;
  travelled_ += next_jog_;
  const double before = volt_, change = volt - volt_;
  const double noise = std::hypot(volt_std, volt_std_);
  const double moved = next_jog_;
  const bool usable = !samples_.isClipped(volt) && !samples_.isClipped(volt_);
  volt_ = volt;
  volt_std_ = volt_std;
  samples_.add(travelled_, volt);
  switch (phase_) {
    case Phase::check_near:
      near_volt_ = volt;
      near_std_ = volt_std;
      phase_ = Phase::check_far;
      return requestJog(-2.0 * options_.check_jog);
    case Phase::check_far: {
      // Symmetric about the rest position: the sensor's curvature cancels (eq. 4.8).
      const double slope = (near_volt_ - volt) / std::abs(moved);
      if (!(slope > 0.0)) return fail("the sensor's voltage does not rise towards the tool");
      result_.sensitivity = 1.0 / slope;
      result_.sensitivity_std =
          result_.sensitivity * std::hypot(std::hypot(near_std_, volt_std) / (near_volt_ - volt),
                                           options_.position_std / std::abs(moved));
      if (options_.curve_jog <= 2.0 * options_.check_jog) return requestReturn();
      phase_ = Phase::bend_near;
      return requestJog(options_.check_jog - 0.5 * options_.curve_jog);
    }
    case Phase::bend_near:
      phase_ = Phase::bend_far;
      return requestJog(-0.5 * options_.curve_jog);
    case Phase::bend_far:
      return requestReturn();
    case Phase::check_back:
      return finish();
    case Phase::approach:
      break;
  }
  if (usable) return updateSensitivity(change, moved, noise);
  // The curve leaves distance, yet the range ends: some point of the tool is in contact or close to it. No
  // further jog.
  if (samples_.isClipped(volt) && volt > 0.0 && moved > 0.0 && !samples_.isClipped(before) &&
      samples_.nominalGap(before) - moved > options_.min_gap) {
    return fail(formatted(
        "a jog of %.0f um took the sensor from %.2f V to the end of its range: a point of the tool is "
        "nearer than the surface in front of the sensor",
        1e6 * moved, before));
  }
  // No sensitivity yet: the longest jog, as in the thesis's program.
  if (!samples_.isClipped(volt)) return requestJog(volt < 0.0 ? options_.first_jog : -options_.first_jog);
  requestJog(volt < 0.0 ? options_.max_jog : -options_.max_jog);
}

void SensorCalibration::requestReturn() {
  phase_ = Phase::check_back;
  requestJog(rest_ - travelled_);
}

void SensorCalibration::moveAway() {
  --samples_away_;
  requestJog(-options_.max_jog);
}

void SensorCalibration::updateSensitivity(double change, double moved, double noise) {
  if (std::abs(moved) < options_.least_jog) return planJog();  // too short for a sensitivity
  const double slope = change / moved;                         // eq. 4.8
  const bool clear = std::abs(change) >= 5.0 * noise;
  // Far away the sensor is hardly sensitive.
  if (!clear && samples_away_ > 0) samples_away_ = 0;
  if (!clear && volt_ < -0.5 * options_.range_volt) return requestJog(options_.max_jog);
  if (!clear || !(slope > 0.0)) {
    return fail(
        formatted("a jog of %.0f um changed the voltage by %.4f V: no sensitivity", 1e6 * moved, change));
  }
  result_.sensitivity = 1.0 / slope;
  result_.sensitivity_std =
      result_.sensitivity * std::hypot(noise / std::abs(change), options_.position_std / std::abs(moved));
  samples_away_ > 0 ? moveAway() : planJog();
}

void SensorCalibration::planJog() {
  const double remaining = -volt_ * result_.sensitivity;  // eq. 4.9
  if (std::abs(volt_) < options_.zero_volt || std::abs(remaining) < options_.resolution) return startCheck();
  const double size = std::abs(remaining) <= options_.least_jog
                          ? std::abs(remaining)
                          : std::clamp(0.5 * std::abs(remaining), options_.least_jog, options_.max_jog);
  requestJog(std::copysign(size, remaining));
}

void SensorCalibration::startCheck() {
  if (options_.check_jog <= 0.0) return finish();
  phase_ = Phase::check_near;
  rest_ = travelled_;
  requestJog(options_.check_jog);
}

void SensorCalibration::finish() {
  const ApproachCurve::Hyperbola curve = samples_.hyperbola(curveVoltStd());
  result_.curve_gap = curve.gap;
  result_.curve_gap_std = curve.gap_std;
  if (std::isfinite(result_.curve_gap) && options_.check_jog > 0.0) {
    // Jogs of +-d measure K / (g^2 - d^2) instead of K / g^2.
    const double share = options_.check_jog / result_.curve_gap;
    result_.sensitivity /= 1.0 - share * share;
  }
  if (result_.limited_by_edges && result_.sensitivity_std > options_.largest_std * result_.sensitivity) {
    return fail(
        formatted("the tool's edges limit the approach to %.2f V, where the standard deviation of the "
                  "sensitivity is %.1f %%",
                  volt_, 100.0 * result_.sensitivity_std / result_.sensitivity));
  }
  state_ = State::done;
}

/// Of a sample of the curve.
double SensorCalibration::curveVoltStd() const {
  return std::hypot(volt_std_, near_std_);
}

std::optional<SensorCurve> SensorCalibration::curve() const {
  return phase_ == Phase::approach ? samples_.curve(curveVoltStd()) : std::nullopt;
}

void SensorCalibration::fail(std::string reason) {
  reason_ = std::move(reason);
  state_ = State::failed;
}

}  // namespace smartmill::hammer
