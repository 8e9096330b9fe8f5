#include "smartmill_hammer/search/sensor_approach.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartmill_core/units.h"

namespace smartmill {
namespace hammer {
namespace {

/// Places of the face's radius that are looked at, and [rad] between two places of the tool.
constexpr int FACE_STEPS = 12;
constexpr double TURN_STEP = 0.03, SAME_TURN = 1e-6;
/// Of the gain over the voltage far off: no nearer to it is read.
constexpr double LEAST_OVER = 0.02;
/// [1] mean distance from a disc's diameter over its radius, 4 / (3 pi): by so much an edge across it reads
/// off.
constexpr double MEAN_ASIDE = 0.4244;
/// [1] to which the approach tells the sensor's curve: its amplifier bends it.
constexpr double SEEN_ERROR = 0.01;

}  // namespace

SensorApproach::SensorApproach(const smartmill::HammerStation& station, const ToolGeometry& tool,
                               const SensorApproachOptions& options)
    : station_(station), tool_(tool), options_(options), curve_error_(options.curve_error) {
  std::vector<double> all;
  for (int tooth = 0; tooth < tool.teeth; ++tooth) {
    for (int found = 0; found < tool.teeth; ++found) all.push_back(turnedFromTooth(0.0, tooth, found));
  }
  for (const double turn : all) {
    const auto same = [&](double other) {
      return std::abs(std::remainder(turn - other, units::TWO_PI)) < SAME_TURN;
    };
    if (std::none_of(turns_.begin(), turns_.end(), same)) turns_.push_back(turn);
  }
}

double SensorApproach::nominalGap(double volt) const {
  return station_.gap_at_zero_volt / std::max(LEAST_OVER, 1.0 + volt / station_.gain_volt);
}

SensorCurve SensorApproach::nominal() const {
  return {-station_.gain_volt, station_.gain_volt * station_.gap_at_zero_volt};
}

/// [m] of a curve whose voltage is larger by the share `error`.
double SensorApproach::gap(double volt, const SensorCurve& curve, double error) {
  return curve.constant / -curve.far_volt / std::max(LEAST_OVER, 1.0 - volt / (1.0 + error) / curve.far_volt);
}

/// [m] at least. A voltage below zero is least far off by the largest gain, one above it by the least.
double SensorApproach::fluteGap() const {
  const double read =
      std::min(gap(flute_volt_, curve_, curve_error_), gap(flute_volt_, curve_, -curve_error_));
  return std::min(2.0 * station_.gap_at_zero_volt, read);
}

/// [m] at least. The largest gain makes both gaps least, and their difference.
double SensorApproach::retreatOf(const Reading& reading) const {
  const double seen = reading.own ? gap(reading.volt, curve_, curve_error_)
                                  : gap(reading.volt, nominal(), options_.curve_error);
  const double depth = seen + reading.moved - gap(flute_volt_, curve_, curve_error_);
  return std::clamp(depth, 0.0, station_.flute_depth);
}

void SensorApproach::fluteSeen(const std::vector<FluteSearch::Reading>& readings, double angle, double volt) {
  curve_ = nominal();
  curve_error_ = options_.curve_error;
  flute_volt_ = volt;
  forget();
  for (const FluteSearch::Reading& r : readings)
    readings_.push_back({nearAngle(r.angle, angle) - angle, r.volt, 0.0, true});
  readAnew();
}

void SensorApproach::forget() {
  readings_.clear();
  profile_.clear();
}

void SensorApproach::readAnew() {
  profile_.clear();
  const double wide = std::asin(std::min(0.9, 0.5 * MEAN_ASIDE * options_.electrode / tool_.radius()));
  for (const Reading& r : readings_) profile_.push_back({r.off + std::copysign(wide, r.off), retreatOf(r)});
}

void SensorApproach::curveSeen(const SensorCurve& curve) {
  const double gain = -curve.far_volt, zero = curve.constant / gain;
  const auto near = [&](double value, double nominal) {
    return std::abs(value / nominal - 1.0) <= options_.curve_error;
  };
  if (!near(gain, station_.gain_volt) || !near(zero, station_.gap_at_zero_volt)) return;
  curve_ = curve;
  curve_error_ = std::min(options_.curve_error, SEEN_ERROR);
  readAnew();
}

/// Of uneven teeth any may be the flute that was found: as far from them as the tool allows, which says
/// least.
void SensorApproach::seen(double turned, double volt, double moved, bool own) {
  double ahead = 0.0, behind = 0.0;
  for (int found = 0; found < tool_.teeth; ++found) {
    double next = units::TWO_PI, last = -units::TWO_PI;
    for (int tooth = 0; tooth < tool_.teeth; ++tooth) {
      const double off = turnedFromTooth(turned, tooth, found);
      if (off >= 0.0) next = std::min(next, off);
      if (off <= 0.0) last = std::max(last, off);
    }
    if (next < units::TWO_PI) ahead = std::max(ahead, next);
    if (last > -units::TWO_PI) behind = std::min(behind, last);
  }
  for (const double place : {ahead, behind}) {
    if (place == 0.0) continue;
    const auto same = [&](const Reading& r) { return r.off == place && r.own == own; };
    readings_.erase(std::remove_if(readings_.begin(), readings_.end(), same), readings_.end());
    readings_.push_back({place, volt, moved, own});
  }
  readAnew();
}

/// [rad] from a tooth, of a place so far from the flute that was found, were that the tooth `found`.
double SensorApproach::turnedFromTooth(double off, int tooth, int found) const {
  return std::remainder(off - tool_.toothAngle(tooth) + tool_.toothAngle(found), units::TWO_PI);
}

double SensorApproach::leastRetreat(double off) const {
  double least = station_.flute_depth;
  for (const double turn : turns_) {
    const double turned = std::remainder(off + turn, units::TWO_PI);
    const double sense = turned < 0.0 ? -1.0 : 1.0, at = sense * turned;
    Retreat below{0.0, 0.0}, above{std::numeric_limits<double>::infinity(), 0.0};
    for (const Retreat& r : profile_) {
      const double place = sense * r.off;
      if (place > below.off && place <= at) below = {place, r.depth};
      if (place > at && place < above.off) above = {place, r.depth};
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

double SensorApproach::leastBetween(double first, double last) const {
  const int steps = 1 + static_cast<int>(std::abs(last - first) / TURN_STEP);
  double least = station_.flute_depth;
  for (int k = 0; k <= steps; ++k) least = std::min(least, leastRetreat(first + (last - first) * k / steps));
  return least;
}

double SensorApproach::travel(const Place& place) const {
  const double radius = tool_.radius(), face = 0.5 * options_.face;
  double behind = 2.0 * radius;
  for (int i = -FACE_STEPS; i <= FACE_STEPS; ++i) {
    const double aside = face * i / FACE_STEPS;
    if (std::abs(aside) > 0.9 * radius) continue;
    const double a = std::asin(aside / radius);
    const double up = std::sqrt(std::max(0.0, face * face - aside * aside));
    const double down = std::min(up, place.above_tip);
    // All heights between turn the edges by all angles between.
    const auto [first, last] =
        std::minmax({-down * place.lag_low, -down * place.lag_high, up * place.lag_low, up * place.lag_high});
    const double retreat = leastBetween(place.turned - a - last, place.turned - a - first);
    behind = std::min(behind, radius - (radius - retreat) * std::cos(a));
  }
  return fluteGap() - options_.min_gap + behind;
}

}  // namespace hammer
}  // namespace smartmill
