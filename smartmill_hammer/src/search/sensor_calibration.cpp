#include "smartmill_hammer/search/sensor_calibration.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Core>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/math/linear_algebra.h"

namespace smartmill::hammer {
namespace {

/// Share of the range from which a voltage does not depend on the distance.
constexpr double RANGE_SHARE = 0.95;
/// Least span of the samples over the required one; iterations of that span by the gap found.
constexpr double LEAST_REACH = 0.2;
constexpr int CURVE_ROUNDS = 4;
/// Range of samples over `curve_jog` that determine the curvature.
constexpr double CURVE_REACH = 1.2;
constexpr std::size_t LEAST_READINGS = 5;
/// [1] standard deviation of the far voltage over the gain, above which the curve is undetermined.
constexpr double KNOWN_FAR = 0.01;
/// [m] shortest jog whose slope gives the gap; ratio of the slopes of two such jogs, at least.
constexpr double LEAST_SLOPE = 10e-6;
constexpr double CLEAR_RISE = 1.05;
/// [1] local over nominal gap, below which an edge sharper than the electrode faces the sensor.
constexpr double SHARP = 0.8;
/// [1] valid gaps of the curve over the nominal gap.
constexpr double LEAST_BEND = 0.08, MOST_BEND = 4.0;

}  // namespace

SensorCalibration::SensorCalibration(const SensorCalibrationOptions& options)
    : options_(options), curve_gap_(std::numeric_limits<double>::quiet_NaN()), curve_gap_std_(curve_gap_) {
  const auto& o = options_;
  if (!(o.least_jog > 0.0 && o.first_jog >= o.least_jog && o.max_jog >= o.first_jog)) {
    throw Error("sensor calibration: expected 0 < least_jog <= first_jog <= max_jog, got " +
                std::to_string(o.least_jog * 1e6) + ", " + std::to_string(o.first_jog * 1e6) + ", " +
                std::to_string(o.max_jog * 1e6) + " um");
  }
}

bool SensorCalibration::isClipped(double volt) const {
  return std::abs(volt) >= RANGE_SHARE * options_.range_volt;
}

double SensorCalibration::nominalGap(double volt) const {
  return options_.gap_at_zero_volt / std::max(1e-3, 1.0 + volt / options_.gain_volt);
}

void SensorCalibration::start(double volt, double volt_std) {
  volt_ = volt;
  volt_std_ = volt_std;
  samples_.push_back({0.0, volt});
  // A short safe travel may result from the uncertain curve alone: determine it by samples further away.
  if (!isClipped(volt) && volt < -options_.zero_volt && options_.curve_jog > 0.0 &&
      options_.safe_travel < static_cast<double>(LEAST_READINGS) * options_.max_jog) {
    samples_away_ = LEAST_READINGS - 1;
    return moveAway();
  }
  if (isClipped(volt)) {
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
      std::min(options_.safe_travel, travelled_ + localGap() - options_.min_gap - options_.swing);
  if (phase_ == Phase::approach && rounded > 0.0 && travelled_ + rounded > safe - options_.check_jog) {
    const double left = safe - options_.check_jog - travelled_;
    const double step = std::floor(left / options_.resolution) * options_.resolution;
    if (step >= options_.least_jog) {
      next_jog_ = step;
      return;
    }
    limited_by_edges_ = true;
    if (sensitivity_ > 0.0) return startCheck();
    // No approach possible: the sensitivity requires a jog, away from the sensor.
    if (samples_.size() == 1 && !isClipped(volt_)) {
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
  if (rounded > 0.0 && nominalGap(volt_) - rounded < options_.min_gap) {
    return fail(formatted("a jog of %.0f um at %.2f V would bring the tool nearer than %.0f um",
                          1e6 * rounded, volt_, 1e6 * options_.min_gap));
  }
  next_jog_ = rounded;
}

/// [m] gap of the hyperbola through the last three samples of the approach, whose slope is proportional to
/// 1 / gap^2. In front of a sharp edge it falls long before the nominal gap does. Infinite: undetermined.
double SensorCalibration::localGap() const {
  const double far = std::numeric_limits<double>::infinity();
  const std::size_t n = samples_.size();
  if (n < 3) return far;
  const Sample &a = samples_[n - 3], &b = samples_[n - 2], &c = samples_[n - 1];
  if (isClipped(a.volt) ||
      !(b.position - a.position >= LEAST_SLOPE && c.position - b.position >= LEAST_SLOPE))
    return far;
  const double before = (b.volt - a.volt) / (b.position - a.position),
               now = (c.volt - b.volt) / (c.position - b.position);
  if (!(before > 0.0 && now > CLEAR_RISE * before)) return far;
  const double between = 0.5 * (c.position - a.position), middle = between / (std::sqrt(now / before) - 1.0);
  const double gap = middle - 0.5 * (c.position - b.position);
  return gap < SHARP * nominalGap(c.volt) ? gap : far;
}

void SensorCalibration::addVoltage(double volt, double volt_std) {
  if (state_ != State::jogging) return;
  ++jogs_;
  travelled_ += next_jog_;
  const double before = volt_, change = volt - volt_;
  const double noise = std::hypot(volt_std, volt_std_);
  const double moved = next_jog_;
  const bool usable = !isClipped(volt) && !isClipped(volt_);
  volt_ = volt;
  volt_std_ = volt_std;
  samples_.push_back({travelled_, volt});
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
      sensitivity_ = 1.0 / slope;
      sensitivity_std_ = sensitivity_ * std::hypot(std::hypot(near_std_, volt_std) / (near_volt_ - volt),
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
  if (isClipped(volt) && volt > 0.0 && moved > 0.0 && !isClipped(before) &&
      nominalGap(before) - moved > options_.min_gap) {
    return fail(formatted(
        "a jog of %.0f um took the sensor from %.2f V to the end of its range: a point of the tool is "
        "nearer than the surface in front of the sensor",
        1e6 * moved, before));
  }
  // No sensitivity yet: the longest jog, as in the thesis's program.
  if (!isClipped(volt)) return requestJog(volt < 0.0 ? options_.first_jog : -options_.first_jog);
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
  sensitivity_ = 1.0 / slope;
  sensitivity_std_ =
      sensitivity_ * std::hypot(noise / std::abs(change), options_.position_std / std::abs(moved));
  samples_away_ > 0 ? moveAway() : planJog();
}

void SensorCalibration::planJog() {
  const double remaining = -volt_ * sensitivity_;  // eq. 4.9
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
  const Hyperbola curve = hyperbola();
  curve_gap_ = curve.gap;
  curve_gap_std_ = curve.gap_std;
  if (std::isfinite(curve_gap_) && options_.check_jog > 0.0) {
    // Jogs of +-d measure K / (g^2 - d^2) instead of K / g^2.
    const double share = options_.check_jog / curve_gap_;
    sensitivity_ /= 1.0 - share * share;
  }
  if (limited_by_edges_ && sensitivity_std_ > options_.largest_std * sensitivity_) {
    return fail(
        formatted("the tool's edges limit the approach to %.2f V, where the standard deviation of the "
                  "sensitivity is %.1f %%",
                  volt_, 100.0 * sensitivity_std_ / sensitivity_));
  }
  state_ = State::done;
}

/// V = a + K / (g - (x - x_now)) through the nearby samples: within `curve_jog` where those exist, otherwise
/// within that gap itself. Further away other regions of the tool contribute.
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

/// Over the samples within `reach` [m]; NaN: undetermined.
SensorCalibration::Hyperbola SensorCalibration::hyperbola(double reach) const {
  std::vector<Sample> near;
  double furthest = 0.0;
  for (const Sample& r : samples_) {
    const double away = std::abs(r.position - travelled_);
    if (isClipped(r.volt) || away > reach) continue;
    near.push_back(r);
    furthest = std::max(furthest, away);
  }
  Hyperbola found = fitHyperbola(near);
  const double share = found.gap / options_.gap_at_zero_volt;
  if (furthest < LEAST_REACH * reach || !(share > LEAST_BEND && share < MOST_BEND))
    found.gap = found.gap_std = std::numeric_limits<double>::quiet_NaN();
  return found;
}

std::optional<SensorCurve> SensorCalibration::curve() const {
  std::vector<Sample> all;
  double nearest = -std::numeric_limits<double>::infinity(), furthest = -nearest;
  for (const Sample& r : samples_) {
    if (isClipped(r.volt)) continue;
    all.push_back(r);
    nearest = std::max(nearest, r.position);
    furthest = std::min(furthest, r.position);
  }
  if (phase_ != Phase::approach || all.size() < LEAST_READINGS ||
      nearest - furthest < options_.gap_at_zero_volt) {
    return std::nullopt;
  }
  const Hyperbola h = fitHyperbola(all);
  if (!(h.gap > 0.0 && h.constant > 0.0 && h.far_volt_std < KNOWN_FAR * options_.gain_volt))
    return std::nullopt;
  return SensorCurve{h.far_volt, h.constant};
}

/// Least squares of V x = g V + a x + c, so that V = a + K / (g - x) with K = -c - a g; NaN: undetermined.
SensorCalibration::Hyperbola SensorCalibration::fitHyperbola(const std::vector<Sample>& near) const {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Hyperbola none{nan, nan, nan, nan, nan};
  if (near.size() < LEAST_READINGS) return none;
  const auto rows = static_cast<Eigen::Index>(near.size());
  Eigen::MatrixXd a(rows, 3), b(rows, 1);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const Sample& r = near[static_cast<std::size_t>(i)];
    const double x = (r.position - travelled_) / options_.gap_at_zero_volt, v = r.volt / options_.range_volt;
    a.row(i) << v, x, 1.0;
    b(i, 0) = v * x;
  }
  const linear::LeastSquares fit = linear::leastSquares(a, b);
  if (fit.rank < 3) return none;
  const double gap = fit.x(0, 0), far = fit.x(1, 0);
  // Errors of each row: of position (a distance has two ends), of voltage, and of the law.
  const Eigen::MatrixXd influence =
      linear::inverseSymmetric(Eigen::MatrixXd(a.transpose() * a)) * a.transpose();
  const double position_error = options_.position_std / std::sqrt(2.0) / options_.gap_at_zero_volt;
  const double volt_error = std::hypot(volt_std_, near_std_) / options_.range_volt;
  double variance[2] = {0.0, 0.0}, squares = 0.0, expected = 0.0;
  for (Eigen::Index i = 0; i < rows; ++i) {
    const double error = std::hypot((a(i, 0) - far) * position_error, (a(i, 1) - gap) * volt_error);
    const double residual = b(i, 0) - a.row(i).dot(fit.x.col(0));
    for (Eigen::Index k = 0; k < 2; ++k) variance[k] += std::pow(influence(k, i) * error, 2);
    squares += residual * residual;
    expected += error * error * static_cast<double>(rows - 3) / static_cast<double>(rows);
  }
  const double misfit = expected > 0.0 ? std::max(1.0, squares / expected) : 1.0;
  return {gap * options_.gap_at_zero_volt, std::sqrt(variance[0] * misfit) * options_.gap_at_zero_volt,
          far * options_.range_volt, std::sqrt(variance[1] * misfit) * options_.range_volt,
          -(fit.x(2, 0) + far * gap) * options_.range_volt * options_.gap_at_zero_volt};
}

void SensorCalibration::fail(std::string reason) {
  reason_ = std::move(reason);
  state_ = State::failed;
}

}  // namespace smartmill::hammer
