#include "smartmill_stability/chatter/speed_search.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <random>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/learning/evidence.h"

namespace smartmill::stability {
namespace {

constexpr double SPEED_STEP = 0.01;  // [1] between speeds of the grid: stable pockets are wider
constexpr std::size_t LINES = 240;   // frequencies of a machine, dense around its modes
constexpr double RULE =
    0.1;  // [1] weight of the rule next to the drawn machines, which may not contain the true one
constexpr double BACKWARDS = 0.1, SAME_BENDING = 0.9, OTHER_MODE = 0.5;  // [1] probabilities
constexpr double NEARLY = 0.95;  // [1] of the largest probability: the faster speed removes more

}  // namespace

SpeedSearch::SpeedSearch(int teeth, double low, double high, const SpeedSearchOptions& options)
    : teeth_(teeth), low_(low), high_(high), options_(options) {
  if (teeth < 1 || teeth > 40) throw Error(formatted("speed search: %d teeth: expected 1 to 40", teeth));
  if (!(low > 0.0) || !(high > low) || !std::isfinite(high))
    throw Error(formatted("speed search: speeds %g to %g rad/s: expected 0 < low < high", low, high));
  speeds_ = 1 + static_cast<std::size_t>(std::ceil(std::log(high / low) / std::log1p(SPEED_STEP)));
}

double SpeedSearch::speedAt(std::size_t k) const {
  return low_ * std::pow(high_ / low_, static_cast<double>(k) / static_cast<double>(speeds_ - 1));
}

std::size_t SpeedSearch::nearest(double speed) const {
  const double at = std::log(speed / low_) / std::log(high_ / low_) * static_cast<double>(speeds_ - 1);
  return static_cast<std::size_t>(std::lround(std::clamp(at, 0.0, static_cast<double>(speeds_ - 1))));
}

/// Machines that chatter in the first cut at the frequency that was heard: the frequencies of their modes are
/// scaled until they do.
void SpeedSearch::draw() {
  constexpr int ATTEMPTS = 6, MOST_DRAWS = 20;
  const HeardCut& first = cuts_.front();
  std::mt19937_64 random(options_.seed + batches_++);
  const std::size_t wanted = machines_.size() + options_.machines;
  std::uniform_real_distribution<double> unit;
  const auto logUniform = [&](double low, double high) { return low * std::pow(high / low, unit(random)); };
  for (std::size_t i = 0; i < MOST_DRAWS * options_.machines && machines_.size() < wanted; ++i) {
    const auto damping = [&] { return logUniform(options_.low_damping, options_.high_damping); };
    const auto sign = [&] { return unit(random) < BACKWARDS ? -1.0 : 1.0; };
    std::vector<Mode> modes{{1.0, damping(), sign()}};
    // The same bending in the other direction, and other modes.
    if (unit(random) < SAME_BENDING)
      modes.push_back({logUniform(0.8, 1.25), damping(), sign() * logUniform(0.2, 2.0)});
    for (int other = 0; other < 2; ++other)
      if (unit(random) < OTHER_MODE)
        modes.push_back({logUniform(0.4, 3.0), damping(), sign() * logUniform(0.05, 1.0)});
    const std::vector<Point> points = pointsOf(modes);
    double scale = *first.frequency;
    std::pair<double, double> limit;
    for (int k = 0; k < ATTEMPTS; ++k) {
      limit = limitAt(points, scale, first.speed);
      if (std::isinf(limit.first)) break;
      scale *= *first.frequency / limit.second;
    }
    if (std::isinf(limit.first) || std::abs(limit.second / *first.frequency - 1.0) > options_.frequency_error)
      continue;
    Machine machine;
    machine.depth = limit.first * logUniform(1.0, options_.largest_ratio);
    for (std::size_t s = 0; s < speeds_; ++s) {
      const auto [depth, frequency] = limitAt(points, scale, speedAt(s));
      machine.limit.push_back(depth);
      machine.frequency.push_back(frequency);
    }
    for (const HeardCut& cut : cuts_) machine.weight *= likelihoodOf(machine, cut);
    machines_.push_back(std::move(machine));
  }
  if (machines_.empty())
    throw Error(formatted("speed search: chatter at %.0f Hz at %.0f rpm: no machine has that",
                          *first.frequency, units::rpmFromRadPerSec(first.speed)));
}

/// Limit and phase between the waves of consecutive teeth over the frequency.
std::vector<SpeedSearch::Point> SpeedSearch::pointsOf(const std::vector<Mode>& modes) {
  std::vector<double> frequencies;
  const auto lines = static_cast<double>(LINES) / static_cast<double>(modes.size());
  for (const Mode& mode : modes)
    for (double k = 0.5; k < lines; k += 1.0) {
      // Quantiles of a Cauchy distribution about the mode, as wide as its resonance and wider.
      const double f = mode.frequency * (1.0 + 1.5 * mode.damping * std::tan(units::PI * (k / lines - 0.5)));
      if (f > 0.3 * mode.frequency && f < 3.0 * mode.frequency) frequencies.push_back(f);
    }
  std::sort(frequencies.begin(), frequencies.end());
  std::vector<Point> points;
  for (const double f : frequencies) {
    std::complex<double> g = 0.0;
    for (const Mode& mode : modes) {
      const double r = f / mode.frequency;
      g += mode.flexibility / std::complex<double>(1.0 - r * r, 2.0 * mode.damping * r);
    }
    const double limit = g.real() < 0.0 ? -0.5 / g.real() : std::numeric_limits<double>::infinity();
    const double phase = units::PI + 2.0 * std::atan2(g.imag(), g.real());  // modulo 2 pi
    const double before = points.empty() ? phase : points.back().phase;
    points.push_back({f, limit, before + std::remainder(phase - before, units::TWO_PI)});
  }
  return points;
}

/// Least limit over the frequencies at which the phase between consecutive waves is that of the tooth passing
/// period, and its frequency [Hz]. @param scale [Hz] of the frequencies of the points
std::pair<double, double> SpeedSearch::limitAt(const std::vector<Point>& points, double scale,
                                               double speed) const {
  const double period = units::TWO_PI / (teeth_ * speed);
  std::pair<double, double> least{std::numeric_limits<double>::infinity(), scale};
  for (std::size_t k = 1; k < points.size(); ++k) {
    const Point &a = points[k - 1], &b = points[k];
    if (std::min(a.limit, b.limit) >= least.first) continue;
    const double from = units::TWO_PI * scale * a.frequency * period - a.phase,
                 to = units::TWO_PI * scale * b.frequency * period - b.phase;
    // Whether a multiple of a turn lies between.
    const double turn = std::ceil(std::min(from, to) / units::TWO_PI) * units::TWO_PI;
    if (turn > std::max(from, to)) continue;
    const double share = to != from ? (turn - from) / (to - from) : 0.5;
    const double limit = std::isinf(a.limit)   ? b.limit
                         : std::isinf(b.limit) ? a.limit
                                               : a.limit + share * (b.limit - a.limit);
    if (limit < least.first) least = {limit, scale * (a.frequency + share * (b.frequency - a.frequency))};
  }
  return least;
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
  if (cut.speed < low_ * (1.0 - ROUNDING) || cut.speed > high_ * (1.0 + ROUNDING))
    throw Error(formatted("speed search: cut at %.0f rpm: expected a speed of the range, %.0f to %.0f rpm",
                          units::rpmFromRadPerSec(cut.speed), units::rpmFromRadPerSec(low_),
                          units::rpmFromRadPerSec(high_)));
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
  for (std::size_t s = 0; s < speeds_; ++s) {
    SpeedProposal proposal{speedAt(s), 0.0};
    for (const Machine& machine : machines_)
      if (!(machine.depth > machine.limit[s])) proposal.stable += machine.weight / all;
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
