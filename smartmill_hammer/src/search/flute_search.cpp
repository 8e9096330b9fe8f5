#include "smartmill_hammer/search/flute_search.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace hammer {
namespace {

const double GOLDEN_RATIO = 0.5 * (1.0 + std::sqrt(5.0));
// Of the larger part, counted from the centre: 1 - 1 / golden ratio.
const double SECTION = 2.0 - GOLDEN_RATIO;
/// Readings this close to the end of the range are out of range.
constexpr double RANGE_SHARE = 0.97;

}  // namespace

double nearAngle(double angle, double reference) {
  return angle - units::TWO_PI * std::round((angle - reference) / units::TWO_PI);
}

FluteSearchOptions FluteSearchOptions::forPitch(double least_pitch) {
  FluteSearchOptions options;
  options.max_step = std::min(options.max_step, 0.25 * least_pitch);
  const double scale = std::min(1.0, 0.0625 * least_pitch / options.first_step);
  options.first_step *= scale;
  options.tolerance *= scale;
  return options;
}

FluteSearch::FluteSearch(double start_angle, const FluteSearchOptions& options)
    : options_(options), start_(start_angle), next_(start_angle), step_(options.first_step) {
  if (!(options.first_step > 0.0) || !(options.max_step >= options.first_step) ||
      !(options.tolerance > 0.0)) {
    throw Error("flute search: first_step " + std::to_string(options.first_step) + ", max_step " +
                std::to_string(options.max_step) + ", tolerance " + std::to_string(options.tolerance) +
                " rad: 0 < first_step <= max_step and tolerance > 0 are due");
  }
}

bool FluteSearch::above(const Point& a, const Point& b) const {
  const double noise = std::hypot(a.volt_std, b.volt_std);
  return a.volt - b.volt > std::max(options_.least_rise, options_.noise_sigmas * noise);
}

void FluteSearch::give(double angle, double volt, double volt_std) {
  if (state_ != State::searching) return;
  ++measurements_;
  const Point p{nearAngle(angle, next_), volt, volt_std};
  if (!bracketed_) {
    bracket(p);
  } else {
    section(p);
  }
}

void FluteSearch::bracket(const Point& p) {
  walk_.push_back(p);
  if (walk_.size() == 1) {
    next_ = p.angle + step_;
    return;
  }
  if (walk_.size() == 2) {
    direction_ = 1.0;
    if (above(walk_[0], walk_[1])) {  // downhill: walk the other way, the first point is then the second
      std::swap(walk_[0], walk_[1]);
      direction_ = -1.0;
    }
  } else {
    const Point& last = walk_.back();
    const auto best = static_cast<std::size_t>(
        std::max_element(walk_.begin(), walk_.end(),
                         [](const Point& a, const Point& b) { return a.volt < b.volt; }) -
        walk_.begin());
    // The nearest point before the best one that is below it: the far end of the bracket.
    std::size_t low = best;
    while (low > 0 && !above(walk_[best], walk_[low])) --low;
    if (above(walk_[best], last) && above(walk_[best], walk_[low])) {
      left_ = walk_[low];
      centre_ = walk_[best];
      right_ = walk_[best + 1];
      for (std::size_t i = best + 1; i < walk_.size() && !above(walk_[best], right_); ++i) right_ = walk_[i];
      if (direction_ < 0.0) std::swap(left_, right_);
      bracketed_ = true;
      if (centre_.volt < -RANGE_SHARE * options_.range_volt) return fail("no flute in the sensor's range");
      return askSection();
    }
    // The walk began on top of the flute: its other flank lies behind the start, so walk on from there.
    if (above(walk_[best], last)) {
      std::reverse(walk_.begin(), walk_.end());
      direction_ = -direction_;
      step_ = options_.first_step / GOLDEN_RATIO;
    }
  }
  const Point& last = walk_.back();
  // One turn and two steps show every flute there is.
  if (std::abs(last.angle - start_) > units::TWO_PI + 2.0 * options_.max_step) {
    double top = walk_.front().volt;
    for (const Point& w : walk_) top = std::max(top, w.volt);
    char text[120];
    std::snprintf(text, sizeof text, "no flute within one turn: the sensor reads %.3f V at most", top);
    return fail(text);
  }
  step_ = std::min(GOLDEN_RATIO * step_, options_.max_step);
  next_ = last.angle + direction_ * step_;
}

double FluteSearch::bracketWidth() const {
  return bracketed_ ? right_.angle - left_.angle : 0.0;
}

void FluteSearch::askSection() {
  if (bracketWidth() <= options_.tolerance) return finish();
  const double to_left = centre_.angle - left_.angle, to_right = right_.angle - centre_.angle;
  next_ = to_right > to_left ? centre_.angle + SECTION * to_right : centre_.angle - SECTION * to_left;
}

void FluteSearch::section(const Point& p) {
  const double before = bracketWidth();
  if (p.volt >= centre_.volt) {
    (p.angle > centre_.angle ? left_ : right_) = centre_;
    centre_ = p;
  } else {
    (p.angle > centre_.angle ? right_ : left_) = p;
  }
  // The spindle stops on 4096 counts: where they are too coarse for the tolerance the bracket stops
  // shrinking.
  if (bracketWidth() >= before) return finish();
  askSection();
}

void FluteSearch::finish() {
  best_volt_ = centre_.volt;
  angle_ = centre_.angle;
  // Vertex of the parabola through the bracket, where its curvature stands out of the noise.
  const double a = left_.angle - centre_.angle, b = right_.angle - centre_.angle;
  const double fa = left_.volt - centre_.volt, fb = right_.volt - centre_.volt;
  const double noise = std::max({left_.volt_std, centre_.volt_std, right_.volt_std});
  const double curvature = a != 0.0 && b != 0.0 ? (fb / b - fa / a) / (b - a) : 0.0;
  if (curvature < 0.0 && -(fa + fb) > 6.0 * noise) {
    const double vertex = -(fa / a * b - fb / b * a) / (b - a) / (2.0 * curvature);
    angle_ += std::clamp(vertex, a, b);
  }
  state_ = State::found;
}

void FluteSearch::fail(std::string reason) {
  reason_ = std::move(reason);
  state_ = State::no_flute;
}

}  // namespace hammer
}  // namespace smartmill
