#include "smartmill_program/tool/tooth_watch.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "smartmill_core/math/angle.h"
#include "smartmill_core/require.h"
#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

using Complex = std::complex<double>;

constexpr std::size_t STEPS = ToothWatch::STEPS;
constexpr double STEP = units::TWO_PI / static_cast<double>(STEPS);  // [rad]
constexpr std::size_t DELAY = 2 * STEPS;                             // from a step to the newest reference
constexpr std::size_t CONFIRM = 7;  // steps; a step of the feed passes the test for less
/// [1] Mean force over (teeth x mean force of a tooth in its own frame): 1 for a narrow arc, pi / 4 for the
/// chip and 2 / pi for the edge of a slot.
constexpr double ARC = 0.85, ARC_STD = 0.16;
constexpr double RADIAL_ANGLE = 0.45;      // [rad] atan(Fr / Ft), 0.3..0.6 for published metals
constexpr double UNKNOWN_DEPTH = 0.5;      // [1] tool radii
constexpr double LEAST_CHIP_SHARE = 0.15;  // [1] of the chip in the force
constexpr double LEAST_SHARE = 0.3;        // [1] of least_force that the teeth without the lost one must have
constexpr double LEAST_OWN = 0.5;          // [1] of the mean share: runout, as far as it is known
// Standard deviations of what a loss leaves as it was, and the largest sum of squares over them.
constexpr double PHASE_STD = 0.6;   // [rad] unknown depth and Fr / Ft
constexpr double FORCE_STD = 0.17;  // [1] of the mean force, over the root of the teeth
constexpr double UNEVEN_STD = 0.8;  // [1] of the mean share
constexpr double DRIFT_STD = 0.14;  // [1] of the change
constexpr double MOST_DEVIATION = 1.5;
constexpr double DEVIATION = 0.3;  // [1] of the largest, from which on a step belongs to the loss

}  // namespace

ToothWatch::ToothWatch(const ToothWatchParameters& parameters) : parameters_(parameters) {
  parameters_.validate();
}

void ToothWatch::setTool(const ToolGeometry& tool, double axial_depth) {
  require("teeth", tool.teeth, Range::closed(1, 1000));
  if (tool.teeth != tool_.teeth) reset();
  tool_ = tool;
  const double depth = axial_depth > 0.0 ? axial_depth : UNKNOWN_DEPTH * tool.radius();
  phase_ = RADIAL_ANGLE + (tool.diameter > 0.0 ? 0.5 * tool.lag() * depth : 0.0);
}

void ToothWatch::reset() {
  last_.reset();
  whole_ = false;
  sum_ = {};
  steps_.clear();
  revolutions_.clear();
  run_ = since_revolution_ = 0;
  revolution_.reset();
}

std::optional<RevolutionForce> ToothWatch::takeRevolution() {
  std::optional<RevolutionForce> taken;
  taken.swap(revolution_);
  return taken;
}

std::optional<ToothLoss> ToothWatch::push(const ForceSample& sample) {
  const Complex force(sample.fx, sample.fy);
  const Point now{sample.time, sample.turned, force, force * std::polar(1.0, sample.turned)};
  const auto step = static_cast<long>(std::floor(sample.turned / STEP));
  std::optional<ToothLoss> loss;
  if (!last_ || step < step_ || step > step_ + 1) {
    if (last_) reset();
  } else if (step == step_) {
    integrate(*last_, now);
  } else {
    const double end = STEP * static_cast<double>(step);
    const double share = (end - last_->turned) / (now.turned - last_->turned);
    const Point between{last_->time + share * (now.time - last_->time), end,
                        last_->force + share * (now.force - last_->force),
                        last_->rotating + share * (now.rotating - last_->rotating)};
    integrate(*last_, between);
    sum_.time = between.time;
    loss = endStep();
    integrate(between, now);
  }
  step_ = step;
  last_ = now;
  return loss;
}

void ToothWatch::integrate(const Point& from, const Point& to) {
  const double half = 0.5 * (to.turned - from.turned) / STEP;
  sum_.force += half * (from.force + to.force);
  sum_.rotating += half * (from.rotating + to.rotating);
}

/// The first step of all is not whole.
std::optional<ToothLoss> ToothWatch::endStep() {
  const Step step = sum_;
  sum_ = {};
  if (!whole_) {
    whole_ = true;
    return {};
  }
  const std::size_t kept = DELAY + static_cast<std::size_t>(parameters_.reference_revolutions) * STEPS;
  steps_.push_back(step);
  if (steps_.size() < STEPS) return {};
  if (steps_.size() > kept) steps_.pop_front();
  RevolutionForce revolution;
  revolution.begin = (steps_.end() - STEPS)->time;
  revolution.time = step.time;
  for (auto s = steps_.end() - STEPS; s != steps_.end(); ++s) {
    revolution.force += s->force / static_cast<double>(STEPS);
    revolution.rotating += s->rotating / static_cast<double>(STEPS);
  }
  revolutions_.push_back(revolution);
  if (revolutions_.size() > kept) revolutions_.pop_front();
  if (++since_revolution_ == STEPS) {
    since_revolution_ = 0;
    revolution_ = revolution;
  }
  return test();
}

/// Revolutions with at least half of the present force.
ToothWatch::Reference ToothWatch::reference() const {
  Reference found;
  const double least = std::max(parameters_.least_force, 0.5 * std::abs(revolutions_.back().force));
  for (std::size_t back = DELAY; back < revolutions_.size(); back += STEPS) {
    const RevolutionForce& revolution = revolutionBefore(back);
    if (std::abs(revolution.force) < least) break;
    ++found.count;
    found.rotating += revolution.rotating;
  }
  if (found.count < LEAST_REFERENCE) return found;
  const auto count = static_cast<double>(found.count);
  const Complex newest = revolutionBefore(DELAY).force;
  const Complex oldest = revolutionBefore(DELAY + (found.count - 1) * STEPS).force;
  const Complex slope = (newest - oldest) / (count - 1.0);  // a revolution
  found.force = newest + static_cast<double>(DELAY) / static_cast<double>(STEPS) * slope;
  found.rotating /= count;
  for (std::size_t k = 0; k < found.count; ++k)
    found.variance += std::norm(revolutionBefore(DELAY + k * STEPS).rotating - found.rotating);
  found.variance /= 2.0 * (count - 1.0);
  found.drift = std::abs(revolutionBefore(DELAY).rotating - found.rotating);
  return found;
}

/// [1] Steps back to the first one whose force differs from that of the references at the same angle.
std::size_t ToothWatch::firstDeviation(std::size_t references) const {
  std::array<double, DELAY> deviation{};
  for (std::size_t back = 0; back < DELAY; ++back) {
    const auto at = [&](std::size_t steps) { return steps_[steps_.size() - 1 - steps].force; };
    Complex mean = 0.0;
    std::size_t count = 0;
    for (std::size_t turn = 1; turn <= references + 1; ++turn) {
      const std::size_t before = back + turn * STEPS;
      if (before < DELAY || before >= steps_.size()) continue;
      mean += at(before);
      ++count;
    }
    if (count > 0) deviation[back] = std::abs(at(back) - mean / static_cast<double>(count));
  }
  const double least = DEVIATION * *std::max_element(deviation.begin(), deviation.end());
  std::size_t back = DELAY - 1;
  while (deviation[back] < least) --back;
  return back;
}

/// @param at [rad] position on the tool
int ToothWatch::nearestTooth(double at) const {
  const auto distance = [&](int tooth) { return std::abs(nearAngle(at - tool_.toothAngle(tooth), 0.0)); };
  int nearest = 0;
  for (int j = 1; j < tool_.teeth; ++j)
    if (distance(j) < distance(nearest)) nearest = j;
  return nearest;
}

std::optional<ToothLoss> ToothWatch::test() {
  const RevolutionForce& now = revolutions_.back();
  const auto fail = [this] {
    run_ = 0;
    return std::nullopt;
  };
  if (tool_.teeth < 2 || revolutions_.size() <= DELAY + (LEAST_REFERENCE - 1) * STEPS ||
      std::abs(now.force) < LEAST_SHARE * parameters_.least_force)
    return fail();
  const auto teeth = static_cast<double>(tool_.teeth);
  const double newest = std::abs(revolutionBefore(DELAY).force) / (teeth * ARC);  // [N] of a tooth
  if (std::abs(now.rotating - revolutionBefore(DELAY).rotating) < 0.25 * newest) return fail();
  const Reference before = reference();
  if (before.count < LEAST_REFERENCE || std::abs(before.force) < parameters_.least_force) return fail();

  const double tooth = std::abs(before.force) / (teeth * ARC);
  const double ratio = std::abs(now.force) / std::abs(before.force);
  const Complex change = now.rotating - before.rotating;
  const double chip_share = std::clamp(1.0 - teeth * (1.0 - ratio), 0.0, 1.0);
  const Complex template_of_first = 1.0 - chip_share * std::polar(1.0, units::TWO_PI / teeth);
  const double variance = before.variance * (1.0 + 1.0 / static_cast<double>(before.count)) +
                          std::pow(parameters_.force_change * tooth, 2);
  const double llr = std::norm(change) / (2.0 * variance);
  const double at = phase_ + std::arg(template_of_first) - std::arg(change);
  const int lost = nearestTooth(at);
  // By runout a tooth has more or less than the mean share: the first harmonic of the shares is Z.
  const double harmonic = tool_.teeth == 2 ? 1.0 : 2.0;
  const Complex uneven = harmonic / teeth * before.rotating / tooth;  // [1] of the mean share
  const double own =
      std::max(1.0 - std::real(uneven * std::polar(1.0, tool_.toothAngle(lost) - phase_)), LEAST_OWN);
  const double least_ratio = 1.0 - (1.0 - LEAST_CHIP_SHARE) * own / teeth;
  const double deviation =
      std::norm(nearAngle(at - tool_.toothAngle(lost), 0.0) / PHASE_STD) +
      std::norm((ratio - std::clamp(ratio, least_ratio, 1.0)) * std::sqrt(teeth) / FORCE_STD) +
      std::norm(uneven / UNEVEN_STD) + std::norm(before.drift / std::abs(change) / DRIFT_STD) +
      (feed_ ? std::norm(parameters_.usual_runout / *feed_) : 0.0);
  const double loss = std::abs(change) / (tooth * own * std::abs(template_of_first));
  const double revolution = now.time - revolutionBefore(STEPS).time;  // [s]
  const double tests = parameters_.false_alarm_hours * 3600.0 / revolution;
  if (!(deviation < MOST_DEVIATION) || loss < parameters_.least_loss || llr < std::log(std::max(tests, 1.0)))
    return fail();
  if (++run_ < CONFIRM) return {};

  ToothLoss found;
  found.stamp = now.time;
  const std::size_t back = firstDeviation(before.count);
  found.lost_at = steps_[steps_.size() - 1 - back].time;
  found.revolutions = static_cast<double>(back) / static_cast<double>(STEPS);
  found.tooth = lost;
  found.loss = loss;
  found.loss_std =
      std::hypot(ARC_STD / ARC, std::sqrt(variance) / (tooth * own * std::abs(template_of_first)));
  found.log_likelihood_ratio = llr;
  reset();  // the tool is another one from here on
  return found;
}

}  // namespace smartmill::program
