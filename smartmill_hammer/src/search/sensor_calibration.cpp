#include "smartmill_hammer/search/sensor_calibration.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Core>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/math/linear_algebra.h"

namespace smartmill {
namespace hammer {
namespace {

/// Readings this close to the end of the range tell nothing about the distance.
constexpr double RANGE_SHARE = 0.95;
/// Readings must reach so far of what is asked; and how often the reach follows the gap found.
constexpr double LEAST_REACH = 0.2;
constexpr int CURVE_ROUNDS = 4;
/// Of the jog that reads the curve's bend.
constexpr double CURVE_REACH = 1.2;
constexpr std::size_t LEAST_READINGS = 5;
/// [1] of the gain: deviation of the voltage far off, above which the curve is not known.
constexpr double KNOWN_FAR = 0.01;
/// [m] of a jog whose slope tells of the gap, and by how much the next one's must be steeper.
constexpr double LEAST_SLOPE = 10e-6;
constexpr double CLEAR_RISE = 1.05;
/// Of the nominal gap: below it something sharper than the sensor's electrode is before it.
constexpr double SHARP = 0.8;
/// A bend beyond these shares of the nominal gap is none.
constexpr double LEAST_BEND = 0.08, MOST_BEND = 4.0;

}  // namespace

SensorCalibration::SensorCalibration(const SensorCalibrationOptions& options)
    : options_(options), bend_gap_(std::numeric_limits<double>::quiet_NaN()), bend_gap_std_(bend_gap_) {
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
  readings_.push_back({0.0, volt});
  // Little room, and perhaps only because the curve is not known: readings further off tell of it first.
  if (!clipped(volt) && volt < -options_.zero_volt && options_.curve_jog > 0.0 &&
      options_.safe_travel < static_cast<double>(LEAST_READINGS) * options_.max_jog) {
    away_ = LEAST_READINGS - 1;
    return further();
  }
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
  const double safe =
      std::min(options_.safe_travel, travelled_ + localGap() - options_.min_gap - options_.swing);
  if (phase_ == Phase::approach && rounded > 0.0 && travelled_ + rounded > safe - options_.check_jog) {
    const double left = safe - options_.check_jog - travelled_;
    const double step = std::floor(left / options_.resolution) * options_.resolution;
    if (step >= options_.least_jog) {
      next_ = step;
      return;
    }
    held_back_ = true;
    if (sensitivity_ > 0.0) return check();
    // Here already: the sensitivity needs a jog all the same, away from the sensor.
    if (readings_.size() == 1 && !clipped(volt_)) {
      next_ = -options_.first_jog;
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
  // The gap read from the nominal curve; out of range there is at least the gap at the end of the range.
  if (rounded > 0.0 && nominalGap(volt_) - rounded < options_.min_gap) {
    return fail(formatted("a jog of %.0f um at %.2f V would bring the tool nearer than %.0f um",
                          1e6 * rounded, volt_, 1e6 * options_.min_gap));
  }
  next_ = rounded;
}

/// [m] gap of the hyperbola through the last three readings of the approach: its slopes go as 1 / gap^2.
/// Where a sharp edge is before the sensor it tells of it long before the nominal curve does. Infinite: it
/// does not tell.
double SensorCalibration::localGap() const {
  const double far = std::numeric_limits<double>::infinity();
  const std::size_t n = readings_.size();
  if (n < 3) return far;
  const Reading &a = readings_[n - 3], &b = readings_[n - 2], &c = readings_[n - 1];
  if (clipped(a.volt) || !(b.at - a.at >= LEAST_SLOPE && c.at - b.at >= LEAST_SLOPE)) return far;
  const double before = (b.volt - a.volt) / (b.at - a.at), now = (c.volt - b.volt) / (c.at - b.at);
  if (!(before > 0.0 && now > CLEAR_RISE * before)) return far;
  const double between = 0.5 * (c.at - a.at), middle = between / (std::sqrt(now / before) - 1.0);
  const double gap = middle - 0.5 * (c.at - b.at);
  return gap < SHARP * nominalGap(c.volt) ? gap : far;
}

void SensorCalibration::give(double volt, double volt_std) {
  if (state_ != State::jogging) return;
  ++jogs_;
  travelled_ += next_;
  const double before = volt_, change = volt - volt_;
  const double noise = std::hypot(volt_std, volt_std_);
  const double moved = next_;
  const bool usable = !clipped(volt) && !clipped(volt_);
  volt_ = volt;
  volt_std_ = volt_std;
  readings_.push_back({travelled_, volt});
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
      if (options_.curve_jog <= 2.0 * options_.check_jog) return askBack();
      phase_ = Phase::bend_near;
      return ask(options_.check_jog - 0.5 * options_.curve_jog);
    }
    case Phase::bend_near:
      phase_ = Phase::bend_far;
      return ask(-0.5 * options_.curve_jog);
    case Phase::bend_far:
      return askBack();
    case Phase::check_back:
      return finish();
    case Phase::approach:
      break;
  }
  if (usable) return approached(change, moved, noise);
  // The curve leaves room, and yet the range ends: something of the tool touches, or is about to. Never
  // again.
  if (clipped(volt) && volt > 0.0 && moved > 0.0 && !clipped(before) &&
      nominalGap(before) - moved > options_.min_gap) {
    return fail(formatted(
        "a jog of %.0f um took the sensor from %.2f V to the end of its range: something of the tool "
        "stands nearer to it than the sensor sees",
        1e6 * moved, before));
  }
  // No sensitivity yet: on by the longest jog (the thesis's program does so too).
  if (!clipped(volt)) return ask(volt < 0.0 ? options_.first_jog : -options_.first_jog);
  ask(volt < 0.0 ? options_.max_jog : -options_.max_jog);
}

void SensorCalibration::askBack() {
  phase_ = Phase::check_back;
  ask(rest_ - travelled_);
}

void SensorCalibration::further() {
  --away_;
  ask(-options_.max_jog);
}

void SensorCalibration::approached(double change, double moved, double noise) {
  if (std::abs(moved) < options_.least_jog) return plan();  // the last bit: too short to tell a sensitivity
  const double slope = change / moved;                      // eq. 4.8
  const bool clear = std::abs(change) >= 5.0 * noise;
  // Far off, hardly sensitive.
  if (!clear && away_ > 0) away_ = 0;
  if (!clear && volt_ < -0.5 * options_.range_volt) return ask(options_.max_jog);
  if (!clear || !(slope > 0.0)) {
    return fail(
        formatted("the sensor answers a jog of %.0f um by %.4f V: no sensitivity", 1e6 * moved, change));
  }
  sensitivity_ = 1.0 / slope;
  sensitivity_std_ =
      sensitivity_ * std::hypot(noise / std::abs(change), options_.position_std / std::abs(moved));
  away_ > 0 ? further() : plan();
}

void SensorCalibration::plan() {
  const double remaining = -volt_ * sensitivity_;  // eq. 4.9
  if (std::abs(volt_) < options_.zero_volt || std::abs(remaining) < options_.resolution) return check();
  const double size = std::abs(remaining) <= options_.least_jog
                          ? std::abs(remaining)
                          : std::clamp(0.5 * std::abs(remaining), options_.least_jog, options_.max_jog);
  ask(std::copysign(size, remaining));
}

void SensorCalibration::check() {
  if (options_.check_jog <= 0.0) return finish();
  phase_ = Phase::check_near;
  rest_ = travelled_;
  ask(options_.check_jog);
}

void SensorCalibration::finish() {
  const Hyperbola curve = hyperbola();
  bend_gap_ = curve.gap;
  bend_gap_std_ = curve.gap_std;
  if (std::isfinite(bend_gap_) && options_.check_jog > 0.0) {
    // K / (g^2 - d^2) is what +-d measures of K / g^2.
    const double share = options_.check_jog / bend_gap_;
    sensitivity_ /= 1.0 - share * share;
  }
  if (held_back_ && sensitivity_std_ > options_.largest_std * sensitivity_) {
    return fail(
        formatted("the tool's edges hold it back at %.2f V, where the sensitivity is known to %.1f %% only",
                  volt_, 100.0 * sensitivity_std_ / sensitivity_));
  }
  state_ = State::done;
}

/// [m] g of V = a + K / (g - (x - x_now)) through the readings nearby: within `curve_jog` where they were
/// taken, else as near as that gap itself where there are enough. Further off another part of the tool
/// counts.
SensorCalibration::Hyperbola SensorCalibration::hyperbola() const {
  if (options_.curve_jog > 2.0 * options_.check_jog) return hyperbola(CURVE_REACH * options_.curve_jog);
  Hyperbola found = hyperbola(options_.gap_at_zero_volt);
  for (int k = 0; k < CURVE_ROUNDS && std::isfinite(found.gap); ++k) {
    const Hyperbola nearer = hyperbola(std::max(found.gap, 2.0 * options_.check_jog));
    if (!std::isfinite(nearer.gap)) break;
    found = nearer;
  }
  return found;
}

/// Over the readings within `reach` [m]; NaN: too few tell.
SensorCalibration::Hyperbola SensorCalibration::hyperbola(double reach) const {
  std::vector<Reading> near;
  double furthest = 0.0;
  for (const Reading& r : readings_) {
    const double away = std::abs(r.at - travelled_);
    if (clipped(r.volt) || away > reach) continue;
    near.push_back(r);
    furthest = std::max(furthest, away);
  }
  Hyperbola found = through(near);
  const double share = found.gap / options_.gap_at_zero_volt;
  if (furthest < LEAST_REACH * reach || !(share > LEAST_BEND && share < MOST_BEND))
    found.gap = found.gap_std = std::numeric_limits<double>::quiet_NaN();
  return found;
}

std::optional<SensorCurve> SensorCalibration::curve() const {
  std::vector<Reading> all;
  double nearest = -std::numeric_limits<double>::infinity(), furthest = -nearest;
  for (const Reading& r : readings_) {
    if (clipped(r.volt)) continue;
    all.push_back(r);
    nearest = std::max(nearest, r.at);
    furthest = std::min(furthest, r.at);
  }
  if (phase_ != Phase::approach || all.size() < LEAST_READINGS ||
      nearest - furthest < options_.gap_at_zero_volt) {
    return std::nullopt;
  }
  const Hyperbola h = through(all);
  if (!(h.gap > 0.0 && h.constant > 0.0 && h.far_volt_std < KNOWN_FAR * options_.gain_volt))
    return std::nullopt;
  return SensorCurve{h.far_volt, h.constant};
}

/// Least squares of V x = g V + a x + c, so that V = a + K / (g - x) with K = -c - a g; NaN: too few tell.
SensorCalibration::Hyperbola SensorCalibration::through(const std::vector<Reading>& near) const {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Hyperbola none{nan, nan, nan, nan, nan};
  if (near.size() < LEAST_READINGS) return none;
  const auto rows = static_cast<Eigen::Index>(near.size());
  Eigen::MatrixXd a(rows, 3), b(rows, 1);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const Reading& r = near[static_cast<std::size_t>(i)];
    const double x = (r.at - travelled_) / options_.gap_at_zero_volt, v = r.volt / options_.range_volt;
    a.row(i) << v, x, 1.0;
    b(i, 0) = v * x;
  }
  const linear::LeastSquares fit = linear::leastSquares(a, b);
  if (fit.rank < 3) return none;
  const double gap = fit.x(0, 0), far = fit.x(1, 0);
  // Of each row's error: of the place (a distance has both its ends'), of the reading, and of the law.
  const Eigen::MatrixXd influence =
      linear::inverseSymmetric(Eigen::MatrixXd(a.transpose() * a)) * a.transpose();
  const double place = options_.position_std / std::sqrt(2.0) / options_.gap_at_zero_volt;
  const double reading = std::hypot(volt_std_, near_std_) / options_.range_volt;
  double variance[2] = {0.0, 0.0}, squares = 0.0, due = 0.0;
  for (Eigen::Index i = 0; i < rows; ++i) {
    const double error = std::hypot((a(i, 0) - far) * place, (a(i, 1) - gap) * reading);
    const double left = b(i, 0) - a.row(i).dot(fit.x.col(0));
    for (Eigen::Index k = 0; k < 2; ++k) variance[k] += std::pow(influence(k, i) * error, 2);
    squares += left * left;
    due += error * error * static_cast<double>(rows - 3) / static_cast<double>(rows);
  }
  const double misfit = due > 0.0 ? std::max(1.0, squares / due) : 1.0;
  return {gap * options_.gap_at_zero_volt, std::sqrt(variance[0] * misfit) * options_.gap_at_zero_volt,
          far * options_.range_volt, std::sqrt(variance[1] * misfit) * options_.range_volt,
          -(fit.x(2, 0) + far * gap) * options_.range_volt * options_.gap_at_zero_volt};
}

void SensorCalibration::fail(std::string reason) {
  reason_ = std::move(reason);
  state_ = State::failed;
}

}  // namespace hammer
}  // namespace smartmill
