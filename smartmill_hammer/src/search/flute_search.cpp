#include "smartmill_hammer/search/flute_search.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/math/angle.h"
#include "smartmill_core/math/normal.h"
#include "smartmill_core/units.h"

namespace smartmill::hammer {
namespace {

const double GOLDEN_RATIO = 0.5 * (1.0 + std::sqrt(5.0));
// Share of the wider side, from the centre: 1 - 1 / golden ratio.
const double SECTION = 2.0 - GOLDEN_RATIO;

}  // namespace

FluteSearchOptions FluteSearchOptions::forPitch(double least_pitch) {
  FluteSearchOptions options;
  options.max_step = std::min(options.max_step, 0.25 * least_pitch);
  const double scale = std::min(1.0, 0.0625 * least_pitch / options.first_step);
  options.first_step *= scale;
  options.tolerance *= scale;
  return options;
}

FluteSearch::FluteSearch(double start_angle, const FluteSearchOptions& options)
    : options_(options), start_(start_angle), next_angle_(start_angle), step_(options.first_step) {
  if (!(options.first_step > 0.0) || !(options.max_step >= options.first_step) ||
      !(options.tolerance > 0.0)) {
    throw Error("flute search: first_step " + std::to_string(options.first_step) + ", max_step " +
                std::to_string(options.max_step) + ", tolerance " + std::to_string(options.tolerance) +
                " rad: expected 0 < first_step <= max_step and tolerance > 0");
  }
}

bool FluteSearch::isClearlyAbove(const Point& a, const Point& b) const {
  const double noise = std::hypot(a.volt_std, b.volt_std);
  return a.volt - b.volt > std::max(options_.least_rise, options_.noise_sigmas * noise);
}

void FluteSearch::addMeasurement(double angle, double volt, double volt_std) {
  if (state_ != State::searching) return;
  const Point p{nearAngle(angle, next_angle_), volt, volt_std};
  measurements_.push_back({p.angle, volt});
  if (!bracketed_) {
    extendBracket(p);
  } else {
    narrowBracket(p);
  }
}

void FluteSearch::extendBracket(const Point& p) {
  walk_.push_back(p);
  if (walk_.size() == 1) {
    next_angle_ = p.angle + step_;
    return;
  }
  if (walk_.size() == 2) {
    direction_ = 1.0;
    if (isClearlyAbove(walk_[0],
                       walk_[1])) {  // falling: step the other way, the first point becomes the second
      std::swap(walk_[0], walk_[1]);
      direction_ = -1.0;
    }
  } else {
    const Point& last = walk_.back();
    const auto best = static_cast<std::size_t>(
        std::max_element(walk_.begin(), walk_.end(),
                         [](const Point& a, const Point& b) { return a.volt < b.volt; }) -
        walk_.begin());
    // The nearest point before the best one that is significantly lower: the far end of the bracket.
    std::size_t low = best;
    while (low > 0 && !isClearlyAbove(walk_[best], walk_[low])) --low;
    if (isClearlyAbove(walk_[best], last) && isClearlyAbove(walk_[best], walk_[low])) {
      left_ = walk_[low];
      centre_ = walk_[best];
      right_ = walk_[best + 1];
      for (std::size_t i = best + 1; i < walk_.size() && !isClearlyAbove(walk_[best], right_); ++i)
        right_ = walk_[i];
      if (direction_ < 0.0) std::swap(left_, right_);
      bracketed_ = true;
      if (centre_.volt < -options_.range_share * options_.range_volt)
        return fail("no flute in the sensor's range");
      return chooseNextAngle();
    }
    // The search began on the flute: its other flank is behind the start, so continue from there.
    if (isClearlyAbove(walk_[best], last)) {
      std::reverse(walk_.begin(), walk_.end());
      direction_ = -direction_;
      step_ = options_.first_step / GOLDEN_RATIO;
    }
  }
  const Point& last = walk_.back();
  // One revolution and two steps pass every flute.
  if (std::abs(last.angle - start_) > units::TWO_PI + 2.0 * options_.max_step) {
    double top = walk_.front().volt;
    for (const Point& w : walk_) top = std::max(top, w.volt);
    return fail(formatted("no flute within one revolution: the highest voltage is %.3f V", top));
  }
  step_ = std::min(GOLDEN_RATIO * step_, options_.max_step);
  next_angle_ = last.angle + direction_ * step_;
}

double FluteSearch::bracketWidth() const {
  return bracketed_ ? right_.angle - left_.angle : 0.0;
}

void FluteSearch::chooseNextAngle() {
  const Parabola p = parabola();
  if (bracketWidth() <= std::max(options_.tolerance, 2.2 * p.resolvable)) return finish();
  widths_.push_back(bracketWidth());
  const std::size_t n = widths_.size();
  const bool slow = n > 2 && widths_[n - 1] > 0.5 * widths_[n - 3];
  if (!options_.golden_only && !slow) {
    next_angle_ = centre_.angle + stepTowardsTop(p);
    return;
  }
  if (slow) widths_.assign(1, bracketWidth());
  const double to_left = centre_.angle - left_.angle, to_right = right_.angle - centre_.angle;
  next_angle_ = to_right > to_left ? centre_.angle + SECTION * to_right : centre_.angle - SECTION * to_left;
}

FluteSearch::Parabola FluteSearch::parabola() const {
  const double a = left_.angle - centre_.angle, b = right_.angle - centre_.angle;
  const double fa = left_.volt - centre_.volt, fb = right_.volt - centre_.volt;
  Parabola p;
  p.curvature = a != 0.0 && b != 0.0 ? (fb / b - fa / a) / (b - a) : 0.0;
  if (!(p.curvature < 0.0)) return p;
  p.vertex = std::clamp(-(fa / a * b - fb / b * a) / (b - a) / (2.0 * p.curvature), a, b);
  const double noise = std::max({left_.volt_std, centre_.volt_std, right_.volt_std});
  p.resolvable = std::min(std::sqrt(options_.below_top_sigmas * noise / -p.curvature), options_.tolerance);
  return p;
}

/// [rad] from the centre to the next measurement: the vertex if it is distant, else close to it on the wider
/// side of the bracket.
double FluteSearch::stepTowardsTop(const Parabola& p) const {
  const double a = left_.angle - centre_.angle, b = right_.angle - centre_.angle;
  const double top = p.vertex, close = std::max(options_.close_share * options_.tolerance, p.resolvable);
  if (!(p.curvature < 0.0)) return b > -a ? SECTION * b : SECTION * a;
  if (std::abs(top) > close && top > 0.9 * a && top < 0.9 * b) return top;
  const double near = std::clamp(top, -close, close);
  // Nearer to the centre two measurements would not differ.
  if (b > -a) return std::min(std::max(near + close, 0.6 * close), 0.9 * b);
  return std::max(std::min(near - close, -0.6 * close), 0.9 * a);
}

void FluteSearch::narrowBracket(const Point& p) {
  const double before = bracketWidth();
  if (p.volt >= centre_.volt) {
    (p.angle > centre_.angle ? left_ : right_) = centre_;
    centre_ = p;
  } else {
    (p.angle > centre_.angle ? right_ : left_) = p;
  }
  // The spindle stops at one of 4096 counts: where they are too coarse for the tolerance the bracket no
  // longer narrows.
  if (bracketWidth() >= before) return finish();
  chooseNextAngle();
}

void FluteSearch::finish() {
  best_volt_ = centre_.volt;
  angle_ = centre_.angle;
  // The parabola's vertex, where its curvature exceeds the noise.
  const double fall = 2.0 * centre_.volt - left_.volt - right_.volt;
  const double noise = std::max({left_.volt_std, centre_.volt_std, right_.volt_std});
  if (fall > 6.0 * noise) angle_ += parabola().vertex;
  const auto below = [&](const Point& end) {
    const double std_dev = std::max(std::hypot(end.volt_std, centre_.volt_std), 1e-12);
    return normalCdf((centre_.volt - end.volt) / std_dev);
  };
  confidence_ = below(left_) * below(right_);
  state_ = State::found;
}

void FluteSearch::fail(std::string reason) {
  reason_ = std::move(reason);
  state_ = State::no_flute;
}

}  // namespace smartmill::hammer
