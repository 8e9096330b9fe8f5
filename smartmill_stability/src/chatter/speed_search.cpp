#include "smartmill_stability/chatter/speed_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <utility>

#include "learning/geometric_grid.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/learning/evidence.h"
#include "smartmill_stability/solvers/zero_order.h"

namespace smartmill::stability {
namespace {

constexpr double SPEED_STEP = 0.01;  // [1] between speeds of the grid: stable pockets are wider
constexpr int LINES = 60;            // frequencies around each mode
constexpr double OTHER_DIRECTION = 0.9, OTHER_MODE = 0.5;  // [1] probabilities
// [1] Weight of the rule next to the drawn machines, which may not contain the true one.
constexpr double RULE = 0.1;
constexpr double NEARLY = 0.95;  // [1] of the largest probability: the faster speed removes more

double logUniform(double low, double high, std::mt19937_64& random) {
  return low * std::pow(high / low, std::uniform_real_distribution<double>()(random));
}

/// Up- or down-milling with an arc of 27 to 180 degrees, fed along x or y. Speeds are those of the tooth
/// passing, and the unit of the limit is arbitrary.
RegenerativeProcess drawProcess(std::mt19937_64& random) {
  std::uniform_real_distribution<double> unit;
  RegenerativeProcess process;
  process.teeth = 1;
  process.kt = 1.0;
  process.radial_ratio = 0.1 + 0.6 * unit(random);
  const double arc = units::PI * std::min(1.0, 0.15 + unit(random));
  const bool down = unit(random) < 0.5, along_y = unit(random) < 0.5;
  process.entry = (down ? units::PI - arc : 0.0) + (along_y ? 0.5 * units::PI : 0.0);
  process.exit = process.entry + arc;
  return process;
}

/// Frequency of a mode relative to the first one: log-uniform, but half of the draws are near another chatter
/// frequency that was heard.
class OtherFrequency {
 public:
  OtherFrequency(const std::vector<HeardCut>& cuts, double spread) : spread_(spread) {
    for (std::size_t k = 1; k < cuts.size(); ++k)
      if (cuts[k].frequency) heard_.push_back(std::log(*cuts[k].frequency / *cuts.front().frequency));
  }
  /// @param weight multiplied by the log-uniform density over that of the draw
  double draw(std::mt19937_64& random, double& weight) const {
    constexpr double LOW = 0.4, HIGH = 3.0;
    if (heard_.empty()) return logUniform(LOW, HIGH, random);
    std::normal_distribution<double> near(0.0, spread_);
    std::uniform_int_distribution<std::size_t> any(0, heard_.size() - 1);
    const double f = std::bernoulli_distribution()(random) ? heard_[any(random)] + near(random)
                                                           : std::log(logUniform(LOW, HIGH, random));
    double density = 0.0;
    for (const double h : heard_)
      density += std::exp(-0.5 * std::pow((f - h) / spread_, 2)) / (spread_ * std::sqrt(units::TWO_PI)) /
                 static_cast<double>(heard_.size());
    const bool possible = f >= std::log(LOW) && f <= std::log(HIGH);
    const double prior = possible ? 1.0 / std::log(HIGH / LOW) : 0.0;
    weight *= prior / (0.5 * prior + 0.5 * density);
    return std::exp(f);
  }

 private:
  double spread_;              // [1] of a frequency
  std::vector<double> heard_;  // logarithms of the ratios
};

/// Receptances over the frequency relative to that of the first mode, on lines dense around the modes.
/// @param weight multiplied by that of the draw
ToolTipResponse drawResponse(const SpeedSearchOptions& options, const OtherFrequency& others,
                             std::mt19937_64& random, double& weight) {
  std::uniform_real_distribution<double> unit;
  std::array<ModalModel, 2> axes;
  const auto add = [&](std::size_t axis, double frequency, double gain) {
    Mode mode;
    mode.frequency = frequency;
    mode.damping_ratio = logUniform(options.low_damping, options.high_damping, random);
    mode.gain = gain;
    axes[axis].modes.push_back(mode);
  };
  add(0, 1.0, 1.0);
  if (unit(random) < OTHER_DIRECTION) add(1, logUniform(0.8, 1.25, random), logUniform(0.2, 5.0, random));
  for (int other = 0; other < 2; ++other)
    if (unit(random) < OTHER_MODE)
      add(unit(random) < 0.5 ? 0 : 1, others.draw(random, weight), logUniform(0.05, 1.0, random));
  ToolTipResponse response;
  for (const ModalModel& axis : axes)
    for (const Mode& mode : axis.modes)
      for (const double f : linesAround(mode.frequency, mode.damping_ratio, LINES))
        response.frequency.push_back(f);
  std::sort(response.frequency.begin(), response.frequency.end());
  for (const double f : response.frequency) {
    response.xx.push_back(axes[0].response(f));
    response.yy.push_back(axes[1].response(f));
  }
  return response;
}

}  // namespace

SpeedSearch::SpeedSearch(int teeth, double low, double high, const SpeedSearchOptions& options)
    : teeth_(teeth), options_(options) {
  if (teeth < 1 || teeth > 40) throw Error(formatted("speed search: %d teeth: expected 1 to 40", teeth));
  if (!(low > 0.0) || !(high > low) || !std::isfinite(high))
    throw Error(formatted("speed search: speeds %g to %g rad/s: expected 0 < low < high", low, high));
  speeds_ = geometricGrid(low, high, SPEED_STEP);
}

std::size_t SpeedSearch::nearest(double speed) const {
  const auto last = static_cast<double>(speeds_.size() - 1);
  const double at = std::log(speed / speeds_.front()) / std::log(speeds_.back() / speeds_.front()) * last;
  return static_cast<std::size_t>(std::lround(std::clamp(at, 0.0, last)));
}

/// Machines that chatter in the first cut at the frequency that was heard: the frequencies of their modes are
/// scaled until they do.
void SpeedSearch::draw() {
  constexpr int ATTEMPTS = 6, MOST_DRAWS = 20;
  const HeardCut& first = cuts_.front();
  std::mt19937_64 random(options_.seed + batches_++);
  const std::size_t wanted = machines_.size() + options_.machines;
  const OtherFrequency others(cuts_, options_.frequency_error);
  for (std::size_t i = 0; i < MOST_DRAWS * options_.machines && machines_.size() < wanted; ++i) {
    const RegenerativeProcess process = drawProcess(random);
    double weight = 1.0;
    const ZeroOrderLobes lobes(process, drawResponse(options_, others, random, weight));
    if (weight == 0.0) continue;
    // Frequencies times a factor: the limits are those at the speeds divided by it.
    double scale = *first.frequency, limit = 0.0, frequency = 0.0;
    for (int k = 0; k < ATTEMPTS; ++k) {
      const StabilityLimit at = lobes.limit({teeth_ * first.speed / scale});
      limit = at.depth.front();
      frequency = scale * at.chatter_frequency.front();
      if (std::isinf(limit)) break;
      scale *= *first.frequency / frequency;
    }
    if (std::isinf(limit) || std::abs(frequency / *first.frequency - 1.0) > options_.frequency_error)
      continue;
    std::vector<double> passing;
    for (const double speed : speeds_) passing.push_back(teeth_ * speed / scale);
    StabilityLimit limits = lobes.limit(passing);
    const double deepest = *std::max_element(limits.depth.begin(), limits.depth.end()) / limit;
    if (deepest < 1.0) continue;
    for (double& f : limits.chatter_frequency) f *= scale;
    Machine machine;
    machine.depth = limit * logUniform(1.0, std::min(deepest, options_.largest_ratio), random);
    machine.limit = std::move(limits.depth);
    machine.frequency = std::move(limits.chatter_frequency);
    machine.weight = weight;
    for (const HeardCut& cut : cuts_) machine.weight *= likelihoodOf(machine, cut);
    machines_.push_back(std::move(machine));
  }
  if (machines_.empty())
    throw Error(formatted("speed search: chatter at %.0f Hz at %.0f rpm: no machine has that",
                          *first.frequency, units::rpmFromRadPerSec(first.speed)));
}

double SpeedSearch::likelihoodOf(const Machine& machine, const HeardCut& cut) const {
  const std::size_t at = nearest(cut.speed);
  const bool chatters = machine.depth > machine.limit[at];
  double likelihood = verdictLikelihood(chatters, cut.frequency.has_value(), options_.wrong);
  if (chatters && cut.frequency)
    likelihood *=
        frequencyLikelihood(machine.frequency[at], *cut.frequency, options_.frequency_error, options_.wrong);
  return likelihood;
}

double SpeedSearch::effectiveMachines() const {
  std::vector<double> weights;
  for (const Machine& machine : machines_) weights.push_back(machine.weight);
  return effectiveCount(weights);
}

void SpeedSearch::heard(const HeardCut& cut) {
  if (!(cut.speed > 0.0) || !std::isfinite(cut.speed))
    throw Error(formatted("speed search: cut at %g rad/s: expected a speed above 0", cut.speed));
  constexpr double ROUNDING = 1e-6;
  const double low = speeds_.front(), high = speeds_.back();
  if (cut.speed < low * (1.0 - ROUNDING) || cut.speed > high * (1.0 + ROUNDING))
    throw Error(formatted("speed search: cut at %.0f rpm: expected a speed of the range, %.0f to %.0f rpm",
                          units::rpmFromRadPerSec(cut.speed), units::rpmFromRadPerSec(low),
                          units::rpmFromRadPerSec(high)));
  if (cut.frequency && (!(*cut.frequency > 0.0) || !std::isfinite(*cut.frequency)))
    throw Error(formatted("speed search: chatter at %g Hz: expected a frequency above 0", *cut.frequency));
  if (cuts_.empty() && !cut.frequency)
    throw Error("speed search: first cut: expected one with chatter; a stable one needs no other speed");
  for (Machine& machine : machines_) machine.weight *= likelihoodOf(machine, cut);
  cuts_.push_back(cut);
  while (effectiveMachines() < options_.effective && batches_ < options_.batches) draw();
}

/// Whether the tooth passing frequency is a divisor of a chatter frequency that was heard.
bool SpeedSearch::followsRule(double speed) const {
  const double passing = teeth_ * speed / units::TWO_PI;
  return std::any_of(cuts_.begin(), cuts_.end(), [&](const HeardCut& cut) {
    if (!cut.frequency) return false;
    const double k = std::round(*cut.frequency / passing);
    return k >= 1.0 && std::abs(*cut.frequency / (k * passing) - 1.0) < 0.5 * SPEED_STEP;
  });
}

std::vector<SpeedProposal> SpeedSearch::proposals() const {
  std::vector<SpeedProposal> result;
  if (machines_.empty()) return result;
  double all = 0.0;
  for (const Machine& machine : machines_) all += machine.weight;
  for (std::size_t s = 0; s < speeds_.size(); ++s) {
    SpeedProposal proposal{speeds_[s], 0.0};
    for (const Machine& machine : machines_)
      if (machine.depth <= machine.limit[s]) proposal.stable += machine.weight / all;
    proposal.stable += RULE * (followsRule(proposal.speed) - proposal.stable);
    for (const HeardCut& cut : cuts_)
      if (cut.frequency && std::abs(cut.speed / proposal.speed - 1.0) < 1.5 * SPEED_STEP)
        proposal.stable = std::min(proposal.stable, options_.wrong);
    result.push_back(proposal);
  }
  return result;
}

SpeedProposal SpeedSearch::next() const {
  const std::vector<SpeedProposal> all = proposals();
  if (all.empty()) throw Error("speed search: expected a cut with chatter before a proposal");
  double most = 0.0;
  for (const SpeedProposal& p : all) most = std::max(most, p.stable);
  SpeedProposal best = all.front();
  for (const SpeedProposal& p : all)
    if (p.stable >= NEARLY * most) best = p;
  return best;
}

std::vector<SpeedProposal> bestProposals(const std::vector<SpeedProposal>& all) {
  constexpr std::size_t MOST = 5, AROUND = 4;  // speeds of the grid
  std::vector<SpeedProposal> best;
  for (std::size_t k = 0; k < all.size(); ++k) {
    const auto from = all.begin() + static_cast<std::ptrdiff_t>(k > AROUND ? k - AROUND : 0);
    const auto to = all.begin() + static_cast<std::ptrdiff_t>(std::min(all.size(), k + AROUND + 1));
    if (std::all_of(from, to, [&](const SpeedProposal& p) { return p.stable <= all[k].stable; }))
      best.push_back(all[k]);
  }
  std::sort(best.begin(), best.end(),
            [](const SpeedProposal& a, const SpeedProposal& b) { return a.stable > b.stable; });
  best.resize(std::min(best.size(), MOST));
  return best;
}

}  // namespace smartmill::stability
