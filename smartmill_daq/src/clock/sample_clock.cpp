#include "smartmill_daq/clock/sample_clock.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace smartmill::daq {
namespace {

// Of the points above the line this one gives their density next to it: the tenth is far enough from the
// two on the line not to be determined by them.
constexpr std::size_t DENSITY_POINT = 12;
constexpr double SUPPORTS = 2.0;  // points on the line
// Standard deviation of the line's end over the mean distance of points next to the line: 3.8 (TCP) to 5
// (USB) in 600 s of simulated arrivals (study daq_clock).
constexpr double END_FACTOR = 4.5;
// [1] of a drift below which the fit's slope replaces the known one: no converter is further off.
constexpr double LARGEST_DRIFT_STD = 1e-4;

}  // namespace

SampleClock::SampleClock(double rate, const SampleClockParameters& parameters)
    : rate_(rate), parameters_(parameters) {
}

bool SampleClock::add(std::uint64_t count, double arrival) {
  if (!begun_) {
    begun_ = true;
    origin_count_ = count;
    origin_ = arrival;
    points_ = {{0.0, 0.0}};
    last_x_ = bin_begin_ = 0.0;
    late_since_ = -1.0;
    state_.offset = 0.0;
    state_.span = 0.0;
    state_.offset_std = parameters_.jump;
    state_.drift = known_drift_;
    state_.drift_std = LARGEST_DRIFT_STD;
    return false;
  }
  const double x = (static_cast<double>(count) - static_cast<double>(origin_count_)) / rate_;
  const Point point{x, arrival - origin_ - x};
  if (jumped(point)) {
    const double jump = point.r - line(x);
    // At the start the device delivers what it had stored.
    const bool stored = jump < 0.0 && state_.span < parameters_.jump_time;
    restart(count);
    add(count, arrival);
    if (stored) return false;
    ++state_.jumps;
    state_.last_jump = jump;
    return true;
  }
  const double distance = point.r - line(x);
  state_.offset = line(x);
  last_x_ = x;
  if (x - bin_begin_ >= parameters_.bin) {
    fit();
    bin_begin_ = x;
    points_.push_back(point);
    while (points_.front().x < x - parameters_.window) points_.pop_front();
  } else if (distance < points_.back().r - line(points_.back().x)) {
    points_.back() = point;
  }
  if (distance < 0.0) fit();
  return false;
}

bool SampleClock::jumped(const Point& point) {
  const double distance = point.r - line(point.x);
  const double limit = std::max(parameters_.jump, 20.0 * state_.offset_std);
  // Before the slope is known the line may lie wrong by its own uncertainty.
  const double reach = 5.0 * state_.drift_std * (point.x - last_x_);
  if (distance < -limit - reach) return true;
  if (distance < limit + reach + 5.0 * state_.jitter) {
    late_since_ = -1.0;
    return false;
  }
  if (late_since_ < 0.0) late_since_ = point.x;
  return point.x - late_since_ > parameters_.jump_time;
}

void SampleClock::fit() {
  state_.span = points_.back().x - points_.front().x;
  std::vector<Point> hull;
  double mean = 0.0;
  for (const Point& point : points_) {
    mean += point.x / static_cast<double>(points_.size());
    const auto above = [&](const Point& a, const Point& b) {  // b is not below the line from a to the point
      return (b.r - a.r) * (point.x - a.x) >= (point.r - a.r) * (b.x - a.x);
    };
    while (hull.size() > 1 && above(hull[hull.size() - 2], hull.back())) hull.pop_back();
    hull.push_back(point);
  }
  double slope = known_drift_;
  if (hull.size() > 1) {
    std::size_t edge = 0;
    while (edge + 2 < hull.size() && hull[edge + 1].x <= mean) ++edge;
    slope = (hull[edge + 1].r - hull[edge].r) / (hull[edge + 1].x - hull[edge].x);
  }
  std::vector<double> above;  // [s] distances of the points from the line
  double base = 0.0;
  const auto measure = [&](double inclination) {
    above.clear();
    for (const Point& point : points_) above.push_back(point.r - inclination * point.x);
    base = *std::min_element(above.begin(), above.end());
    for (double& distance : above) distance -= base;
  };
  const auto ranked = [&above](std::size_t rank) {
    std::nth_element(above.begin(), above.begin() + static_cast<std::ptrdiff_t>(rank), above.end());
    return above[rank];
  };
  const auto spacing = [&] {  // [s] mean distance of neighbours next to the line
    const std::size_t point = std::min(DENSITY_POINT, above.size() - 1);
    return ranked(point) / std::max(1.0, static_cast<double>(point) - SUPPORTS);
  };
  measure(slope);
  double end_std = END_FACTOR * spacing();
  // The line turns about the middle of the window.
  double drift_std = state_.span > 0.0 ? 2.0 * end_std / state_.span : 1.0;
  const bool significant = std::abs(slope - known_drift_) > 5.0 * drift_std;
  if (points_.size() < 4 || (drift_std > LARGEST_DRIFT_STD && !significant)) {
    slope = known_drift_;
    measure(slope);
    end_std = std::max(END_FACTOR * spacing(), LARGEST_DRIFT_STD * state_.span / 2.0);
    drift_std = LARGEST_DRIFT_STD;
  } else {
    known_drift_ = slope;
  }
  state_.drift = slope;
  state_.drift_std = drift_std;
  state_.offset = base + slope * last_x_;
  state_.offset_std = end_std;
  state_.jitter = ranked(above.size() / 2);
}

double SampleClock::timeOf(double count) const {
  const double x = (count - static_cast<double>(origin_count_)) / rate_;
  return origin_ + (x + line(x));
}

void SampleClock::restart(std::uint64_t count) {
  begun_ = false;
  origin_count_ = count;
  points_.clear();
}

}  // namespace smartmill::daq
