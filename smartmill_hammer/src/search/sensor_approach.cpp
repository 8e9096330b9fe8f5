#include "smartmill_hammer/search/sensor_approach.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartmill_core/math/angle.h"
#include "smartmill_core/units.h"

namespace smartmill::hammer {
namespace {

constexpr double SAME_TURN = 1e-6;  // [rad] equal angles
/// [1] of the gain above the voltage far from the sensor: smallest value from which a gap is computed.
constexpr double LEAST_OVER = 0.02;
/// [1] mean distance from a disc's diameter over its radius, 4 / (3 pi).
constexpr double MEAN_DISC_DISTANCE = 0.4244;

}  // namespace

SensorApproach::SensorApproach(const smartmill::HammerStation& station, const ToolGeometry& tool,
                               const SensorApproachOptions& options)
    : station_(station), tool_(tool), options_(options), curve_error_(options.curve_error) {
  std::vector<double> all;
  for (int tooth = 0; tooth < tool.teeth; ++tooth) {
    for (int found = 0; found < tool.teeth; ++found) all.push_back(rotationFromTooth(0.0, tooth, found));
  }
  for (const double turn : all) {
    const auto same = [&](double other) {
      return std::abs(std::remainder(turn - other, units::TWO_PI)) < SAME_TURN;
    };
    if (std::none_of(tooth_rotations_.begin(), tooth_rotations_.end(), same))
      tooth_rotations_.push_back(turn);
  }
}

double SensorApproach::nominalGap(double volt) const {
  return station_.gap_at_zero_volt / std::max(LEAST_OVER, 1.0 + volt / station_.gain_volt);
}

SensorCurve SensorApproach::nominal() const {
  return {-station_.gain_volt, station_.gain_volt * station_.gap_at_zero_volt};
}

/// [m] gap by a curve whose voltage is larger by the share `error`.
double SensorApproach::gap(double volt, const SensorCurve& curve, double error) {
  return curve.constant / -curve.far_volt / std::max(LEAST_OVER, 1.0 - volt / (1.0 + error) / curve.far_volt);
}

/// [m] smallest possible gap: by the largest gain for a voltage below zero, by the smallest above.
double SensorApproach::fluteGap() const {
  const double read =
      std::min(gap(flute_volt_, curve_, curve_error_), gap(flute_volt_, curve_, -curve_error_));
  return std::min(2.0 * station_.gap_at_zero_volt, read);
}

/// [m] smallest possible depth: the largest gain gives the smallest gaps and difference.
double SensorApproach::retreatOf(const FlankMeasurement& measurement) const {
  const double distance = measurement.same_sensor ? gap(measurement.volt, curve_, curve_error_)
                                                  : gap(measurement.volt, nominal(), options_.curve_error);
  const double depth = distance + measurement.moved - gap(flute_volt_, curve_, curve_error_);
  return std::clamp(depth, 0.0, station_.flute_depth);
}

void SensorApproach::startFromFlute(const std::vector<FluteSearch::Measurement>& measurements, double angle,
                                    double volt) {
  curve_ = nominal();
  curve_error_ = options_.curve_error;
  flute_volt_ = volt;
  clearFlanks();
  for (const FluteSearch::Measurement& r : measurements)
    measurements_.push_back({nearAngle(r.angle, angle) - angle, r.volt, 0.0, true});
  updateProfile();
}

void SensorApproach::clearFlanks() {
  measurements_.clear();
  profile_.clear();
}

void SensorApproach::updateProfile() {
  profile_.clear();
  const double wide =
      std::asin(std::min(0.9, 0.5 * MEAN_DISC_DISTANCE * options_.electrode / tool_.radius()));
  for (const FlankMeasurement& r : measurements_)
    profile_.push_back({r.off + std::copysign(wide, r.off), retreatOf(r)});
}

void SensorApproach::setCurve(const SensorCurve& curve) {
  const double gain = -curve.far_volt, zero = curve.constant / gain;
  const auto near = [&](double value, double nominal) {
    return std::abs(value / nominal - 1.0) <= options_.curve_error;
  };
  if (!near(gain, station_.gain_volt) || !near(zero, station_.gap_at_zero_volt)) return;
  curve_ = curve;
  curve_error_ = std::min(options_.curve_error, options_.measured_curve_error);
  updateProfile();
}

/// Of uneven teeth any may be the flute that was found: the largest distance from them is the weakest
/// statement.
void SensorApproach::addMeasurement(double turned, double volt, double moved, bool same_sensor) {
  double ahead = 0.0, behind = 0.0;
  for (int found = 0; found < tool_.teeth; ++found) {
    double next = units::TWO_PI, last = -units::TWO_PI;
    for (int tooth = 0; tooth < tool_.teeth; ++tooth) {
      const double off = rotationFromTooth(turned, tooth, found);
      if (off >= 0.0) next = std::min(next, off);
      if (off <= 0.0) last = std::max(last, off);
    }
    if (next < units::TWO_PI) ahead = std::max(ahead, next);
    if (last > -units::TWO_PI) behind = std::min(behind, last);
  }
  for (const double angle : {ahead, behind}) {
    if (angle == 0.0) continue;
    const auto same = [&](const FlankMeasurement& r) {
      return r.off == angle && r.same_sensor == same_sensor;
    };
    measurements_.erase(std::remove_if(measurements_.begin(), measurements_.end(), same),
                        measurements_.end());
    measurements_.push_back({angle, volt, moved, same_sensor});
  }
  updateProfile();
}

/// [rad] from a tooth, of an angle from the flute found if that is the tooth `found`.
double SensorApproach::rotationFromTooth(double off, int tooth, int found) const {
  return std::remainder(off - tool_.toothAngle(tooth) + tool_.toothAngle(found), units::TWO_PI);
}

double SensorApproach::leastRetreat(double off) const {
  double least = station_.flute_depth;
  for (const double turn : tooth_rotations_) {
    const double turned = std::remainder(off + turn, units::TWO_PI);
    const double sense = turned < 0.0 ? -1.0 : 1.0, at = sense * turned;
    Retreat below{0.0, 0.0}, above{std::numeric_limits<double>::infinity(), 0.0};
    for (const Retreat& r : profile_) {
      const double angle = sense * r.off;
      if (angle > below.off && angle <= at) below = {angle, r.depth};
      if (angle > at && angle < above.off) above = {angle, r.depth};
    }
    double depth = below.depth;
    if (std::isfinite(above.off) && above.depth > below.depth) {
      const double share = (at - below.off) / (above.off - below.off);
      const double root = std::sqrt(below.depth) + share * (std::sqrt(above.depth) - std::sqrt(below.depth));
      depth = root * root;
    }
    least = std::min(least, depth);
  }
  return least;
}

double SensorApproach::leastRetreatBetween(double first, double last) const {
  const int steps = 1 + static_cast<int>(std::abs(last - first) / options_.turn_step);
  double least = station_.flute_depth;
  for (int k = 0; k <= steps; ++k) least = std::min(least, leastRetreat(first + (last - first) * k / steps));
  return least;
}

double SensorApproach::safeTravel(const Pose& pose) const {
  const double radius = tool_.radius(), face = 0.5 * options_.face;
  double behind = 2.0 * radius;
  for (int i = -options_.face_steps; i <= options_.face_steps; ++i) {
    const double aside = face * i / options_.face_steps;
    if (std::abs(aside) > 0.9 * radius) continue;
    const double a = std::asin(aside / radius);
    const double up = std::sqrt(std::max(0.0, face * face - aside * aside));
    const double down = std::min(up, pose.above_tip);
    // The heights covered by the face turn the edges by all angles between these.
    const auto [first, last] =
        std::minmax({-down * pose.lag_low, -down * pose.lag_high, up * pose.lag_low, up * pose.lag_high});
    const double retreat = leastRetreatBetween(pose.turned - a - last, pose.turned - a - first);
    behind = std::min(behind, radius - (radius - retreat) * std::cos(a));
  }
  return fluteGap() - options_.min_gap + behind;
}

}  // namespace smartmill::hammer
