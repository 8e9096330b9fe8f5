#include "smartmill_hammer/search/sensor_calibration.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "smartmill_core/error.h"

namespace smartmill {
namespace hammer {
namespace {

/// Readings this close to the end of the range tell nothing about the distance.
constexpr double RANGE_SHARE = 0.95;

}  // namespace

SensorCalibration::SensorCalibration(const SensorCalibrationOptions& options) : options_(options) {
  const auto& o = options_;
  if (!(o.least_jog > 0.0 && o.first_jog >= o.least_jog && o.max_jog >= o.first_jog)) {
    throw Error("sensor calibration: 0 < least_jog <= first_jog <= max_jog is due, got " +
                std::to_string(o.least_jog * 1e6) + ", " + std::to_string(o.first_jog * 1e6) + ", " +
                std::to_string(o.max_jog * 1e6) + " um");
  }
}

bool SensorCalibration::clipped(double volt) const {
  return std::abs(volt) >= RANGE_SHARE * options_.range_volt;
}

double SensorCalibration::nominalGap(double volt) const {
  return options_.gap_at_zero_volt / std::max(1e-3, 1.0 + volt / options_.gain_volt);
}

void SensorCalibration::start(double volt, double volt_std) {
  volt_ = volt;
  volt_std_ = volt_std;
  if (clipped(volt)) {
    ask(volt < 0.0 ? options_.max_jog : -options_.max_jog);
  } else {
    // At zero already: the sensitivity needs a jog all the same, away from the sensor.
    ask(volt < -options_.zero_volt ? options_.first_jog : -options_.first_jog);
  }
}

void SensorCalibration::ask(double distance) {
  const double rounded = std::round(distance / options_.resolution) * options_.resolution;
  if (jogs_ >= options_.max_jogs) {
    return fail("the sensor's voltage is not zero after " + std::to_string(jogs_) + " jogs");
  }
  if (travelled_ + rounded > options_.max_travel) {
    char text[120];
    std::snprintf(text, sizeof text, "the tool is still out of the sensor's range %.2f mm nearer (%.2f V)",
                  1e3 * travelled_, volt_);
    return fail(text);
  }
  // The gap read from the nominal curve; out of range there is at least the gap at the end of the range.
  if (rounded > 0.0 && nominalGap(volt_) - rounded < options_.min_gap) {
    char text[120];
    std::snprintf(text, sizeof text, "a jog of %.0f um at %.2f V would bring the tool nearer than %.0f um",
                  1e6 * rounded, volt_, 1e6 * options_.min_gap);
    return fail(text);
  }
  next_ = rounded;
}

void SensorCalibration::give(double volt, double volt_std) {
  if (state_ != State::jogging) return;
  ++jogs_;
  travelled_ += next_;
  const double change = volt - volt_;
  const double noise = std::hypot(volt_std, volt_std_);
  const double moved = next_;
  const bool usable = !clipped(volt) && !clipped(volt_);
  volt_ = volt;
  volt_std_ = volt_std;
  switch (phase_) {
    case Phase::check_near:
      near_volt_ = volt;
      near_std_ = volt_std;
      phase_ = Phase::check_far;
      return ask(-2.0 * options_.check_jog);
    case Phase::check_far: {
      // Symmetric about the place where the tool stays: the sensor's curvature cancels (eq. 4.8).
      const double slope = (near_volt_ - volt) / std::abs(moved);
      if (!(slope > 0.0)) return fail("the sensor's voltage does not rise towards the tool");
      sensitivity_ = 1.0 / slope;
      sensitivity_std_ = sensitivity_ * std::hypot(std::hypot(near_std_, volt_std) / (near_volt_ - volt),
                                                   options_.position_std / std::abs(moved));
      phase_ = Phase::check_back;
      return ask(options_.check_jog);
    }
    case Phase::check_back:
      state_ = State::done;
      return;
    case Phase::approach:
      break;
  }
  if (!usable) {  // no sensitivity yet: on by the longest jog (the thesis's program does so too)
    if (!clipped(volt)) return ask(volt < 0.0 ? options_.first_jog : -options_.first_jog);
    return ask(volt < 0.0 ? options_.max_jog : -options_.max_jog);
  }
  const double slope = change / moved;  // eq. 4.8
  const bool clear = std::abs(change) >= 5.0 * noise;
  if (!clear && volt < -0.5 * options_.range_volt) return ask(options_.max_jog);  // far off, hardly sensitive
  if (!clear || !(slope > 0.0)) {
    char text[120];
    std::snprintf(text, sizeof text, "the sensor answers a jog of %.0f um by %.4f V: no sensitivity",
                  1e6 * moved, change);
    return fail(text);
  }
  sensitivity_ = 1.0 / slope;
  sensitivity_std_ =
      sensitivity_ * std::hypot(noise / std::abs(change), options_.position_std / std::abs(moved));
  plan();
}

void SensorCalibration::plan() {
  const double remaining = -volt_ * sensitivity_;  // eq. 4.9
  if (std::abs(volt_) <= options_.zero_volt || std::abs(remaining) <= 0.5 * options_.least_jog) {
    if (options_.check_jog <= 0.0) {
      state_ = State::done;
      return;
    }
    phase_ = Phase::check_near;
    return ask(options_.check_jog);
  }
  const double size = std::clamp(0.5 * std::abs(remaining), options_.least_jog, options_.max_jog);
  ask(std::copysign(size, remaining));
}

void SensorCalibration::fail(std::string reason) {
  reason_ = std::move(reason);
  state_ = State::failed;
}

}  // namespace hammer
}  // namespace smartmill
