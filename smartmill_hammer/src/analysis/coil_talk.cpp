#include "smartmill_hammer/analysis/coil_talk.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/signal/window.h"

namespace smartmill {
namespace hammer {
namespace {

/// Samples of a level; deviations above which a difference is one; of what still rings, so much may be a
/// level.
constexpr std::size_t LEAST_SAMPLES = 48;
constexpr double CLEAR = 4.0, RINGING_SHARE = 0.1;
/// Of its size, a step that has died away.
constexpr double DIED = 0.1;
/// [s] time constants of a current, and the one of a solenoid whose force does not tell it; steps of the
/// search.
constexpr double SHORTEST = 0.3e-3, LONGEST = 10e-3, USUAL = 3e-3;
constexpr int STEPS = 36;

using Values = std::vector<double>;

Values part(const Values& values, std::size_t from, std::size_t to) {
  return {values.begin() + static_cast<std::ptrdiff_t>(from),
          values.begin() + static_cast<std::ptrdiff_t>(to)};
}

struct Step {
  double before = 0.0, end = 0.0, largest = 0.0;
  bool clear = false;

  double size() const { return before - end; }
};

/// Under a Hann window, in which what rings has no mean.
double levelOf(const Values& values) {
  const Values window = hannWindow(values.size());
  double sum = 0.0, weights = 0.0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    sum += window[i] * values[i];
    weights += window[i];
  }
  return sum / weights;
}

/// Levels before the touch and in the last fifth. By a third of the record a current has died away: what is
/// still on its way there is a drift.
Step stepOf(const Values& values, std::size_t quiet) {
  Step step;
  const Values before = part(values, 0, quiet),
               after = part(values, values.size() - values.size() / 5, values.size());
  step.end = levelOf(after);
  step.before = mean(before);
  for (const double v : values) step.largest = std::max(step.largest, std::abs(v - step.end));
  const double noise = standardDeviation(before);
  const double of_levels =
      noise * std::sqrt(1.0 / static_cast<double>(before.size()) + 1.5 / static_cast<double>(after.size()));
  const double rings = std::max(0.0, standardDeviation(after) - 1.5 * noise);
  const Values middle = part(values, values.size() / 3, values.size() / 2);
  const double rings_there = std::max(0.0, standardDeviation(middle) - 1.5 * noise);
  const double on_its_way =
      std::abs(levelOf(middle) - step.end) - CLEAR * of_levels - RINGING_SHARE * rings_there;
  step.clear = std::abs(step.size()) > CLEAR * of_levels + RINGING_SHARE * rings &&
               on_its_way < DIED * std::abs(step.size());
  return step;
}

/// [s] of the decay that fits the force best behind its contact.
double decayTime(const Values& force, const Step& step, std::size_t touch, std::size_t from, double rate) {
  const auto to = std::min(force.size(), touch + static_cast<std::size_t>(4.0 * LONGEST * rate));
  double best = USUAL, least = INFINITY;
  for (int k = 0; k <= STEPS; ++k) {
    const double time = SHORTEST * std::pow(LONGEST / SHORTEST, static_cast<double>(k) / STEPS);
    double squares = 0.0;
    for (std::size_t i = from; i < to; ++i) {
      const double due = step.end + step.size() * std::exp(-static_cast<double>(i - touch) / (rate * time));
      squares += (force[i] - due) * (force[i] - due);
    }
    if (squares < least) least = squares, best = time;
  }
  return best;
}

void takeOff(Values& values, const Step& step, double most, std::size_t touch, double samples) {
  if (!step.clear || std::abs(step.size()) > most * step.largest) return;
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] -= step.size() * (i < touch ? 1.0 : std::exp(-static_cast<double>(i - touch) / samples));
}

}  // namespace

void removeCoilTalk(Hit& hit, double most) {
  const std::size_t quiet = hit.pre_trigger - hit.pre_trigger / 4;
  if (!(most > 0.0) || quiet < LEAST_SAMPLES || hit.force.size() < 10 * LEAST_SAMPLES) return;
  for (const Values* values : {&hit.force, &hit.response}) {
    for (const double v : *values) {
      if (!std::isfinite(v)) return;
    }
  }
  const Step force = stepOf(hit.force, quiet), response = stepOf(hit.response, quiet);
  const auto top =
      static_cast<std::size_t>(std::max_element(hit.force.begin(), hit.force.end()) - hit.force.begin());
  const double contact =
      std::max(0.02 * (hit.force[top] - force.before), CLEAR * standardDeviation(part(hit.force, 0, quiet)));
  std::size_t touch = top, end = top;
  while (touch > quiet && hit.force[touch] - force.before > contact) --touch;
  const double behind = std::max(contact, 1.5 * std::abs(force.size()));
  while (end + 1 < hit.force.size() && hit.force[end] - force.end > behind) ++end;
  const double time = force.clear ? decayTime(hit.force, force, touch, end + 2, hit.sample_rate) : USUAL;
  takeOff(hit.force, force, most, touch, time * hit.sample_rate);
  takeOff(hit.response, response, most, touch, time * hit.sample_rate);
}

}  // namespace hammer
}  // namespace smartmill
