#include "smartmill_hammer/analysis/solenoid_crosstalk.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "smartmill_core/modal/impact_analysis.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/signal/window.h"

namespace smartmill::hammer {
namespace {

using Values = std::vector<double>;

Values slice(const Values& values, std::size_t from, std::size_t to) {
  return {values.begin() + static_cast<std::ptrdiff_t>(from),
          values.begin() + static_cast<std::ptrdiff_t>(to)};
}

struct Step {
  double before = 0.0, end = 0.0, largest = 0.0;
  bool significant = false;

  double size() const { return before - end; }
};

/// Mean under a Hann window, which suppresses ringing.
double levelOf(const Values& values) {
  const Values window = hannWindow(values.size());
  double sum = 0.0, weights = 0.0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    sum += window[i] * values[i];
    weights += window[i];
  }
  return sum / weights;
}

/// Levels before the contact and in the last fifth. By a third of the record a current has decayed: a level
/// that still changes there is a drift.
Step levelStep(const Values& values, std::size_t quiet, const SolenoidCrosstalkOptions& options) {
  Step step;
  const Values before = slice(values, 0, quiet),
               after = slice(values, values.size() - values.size() / 5, values.size());
  step.end = levelOf(after);
  step.before = mean(before);
  for (const double v : values) step.largest = std::max(step.largest, std::abs(v - step.end));
  const double noise = standardDeviation(before);
  const double of_levels =
      noise * std::sqrt(1.0 / static_cast<double>(before.size()) + 1.5 / static_cast<double>(after.size()));
  const double end_ringing = std::max(0.0, standardDeviation(after) - 1.5 * noise);
  const Values middle = slice(values, values.size() / 3, values.size() / 2);
  const double middle_ringing = std::max(0.0, standardDeviation(middle) - 1.5 * noise);
  const double remaining = std::abs(levelOf(middle) - step.end) - options.significant * of_levels -
                           options.ringing_share * middle_ringing;
  step.significant =
      std::abs(step.size()) > options.significant * of_levels + options.ringing_share * end_ringing &&
      remaining < options.decayed_share * std::abs(step.size());
  return step;
}

/// [s] time constant that fits the force best after its contact.
double decayTime(const Values& force, const Step& step, std::size_t contact_start, std::size_t from,
                 double rate, const SolenoidCrosstalkOptions& options) {
  const auto to =
      std::min(force.size(), contact_start + static_cast<std::size_t>(4.0 * options.longest * rate));
  double best = options.usual, least = INFINITY;
  for (int k = 0; k <= options.steps; ++k) {
    const double time = options.shortest *
                        std::pow(options.longest / options.shortest, static_cast<double>(k) / options.steps);
    double squares = 0.0;
    for (std::size_t i = from; i < to; ++i) {
      const double expected =
          step.end + step.size() * std::exp(-static_cast<double>(i - contact_start) / (rate * time));
      squares += (force[i] - expected) * (force[i] - expected);
    }
    if (squares < least) least = squares, best = time;
  }
  return best;
}

void subtractDecay(Values& values, const Step& step, double largest_share, std::size_t contact_start,
                   double samples) {
  if (!step.significant || std::abs(step.size()) > largest_share * step.largest) return;
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] -=
        step.size() * (i < contact_start ? 1.0 : std::exp(-static_cast<double>(i - contact_start) / samples));
}

}  // namespace

void removeSolenoidCrosstalk(Hit& hit, double largest_share, const SolenoidCrosstalkOptions& options) {
  const std::size_t quiet = hit.pre_trigger - hit.pre_trigger / 4;
  if (!(largest_share > 0.0) || quiet < LEAST_QUIET_SAMPLES || hit.force.size() < 10 * LEAST_QUIET_SAMPLES)
    return;
  for (const Values* values : {&hit.force, &hit.response}) {
    for (const double v : *values) {
      if (!std::isfinite(v)) return;
    }
  }
  const Step force = levelStep(hit.force, quiet, options), response = levelStep(hit.response, quiet, options);
  const auto top =
      static_cast<std::size_t>(std::max_element(hit.force.begin(), hit.force.end()) - hit.force.begin());
  const double contact = std::max(0.02 * (hit.force[top] - force.before),
                                  options.significant * standardDeviation(slice(hit.force, 0, quiet)));
  std::size_t contact_start = top, end = top;
  while (contact_start > quiet && hit.force[contact_start] - force.before > contact) --contact_start;
  const double after_contact = std::max(contact, 1.5 * std::abs(force.size()));
  while (end + 1 < hit.force.size() && hit.force[end] - force.end > after_contact) ++end;
  const double time = force.significant
                          ? decayTime(hit.force, force, contact_start, end + 2, hit.sample_rate, options)
                          : options.usual;
  subtractDecay(hit.force, force, largest_share, contact_start, time * hit.sample_rate);
  subtractDecay(hit.response, response, largest_share, contact_start, time * hit.sample_rate);
}

}  // namespace smartmill::hammer
