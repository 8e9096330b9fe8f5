#include "stability/speed_tries.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

constexpr double HEARD_ERROR = 0.003;  // [1] of a chatter frequency
constexpr double SAME_SPEED = 0.01;    // [1] of a rule that does not repeat speeds

bool wasTried(const std::vector<double>& tried, double speed) {
  return std::any_of(tried.begin(), tried.end(),
                     [&](double before) { return std::abs(speed / before - 1.0) < SAME_SPEED; });
}

}  // namespace

ChatteringCut drawChatteringCut(std::mt19937_64& random) {
  std::uniform_real_distribution<double> unit;
  const auto uniform = [&](double low, double high) { return low + (high - low) * unit(random); };
  constexpr double MAX_DEPTH = 0.1;  // [m]
  constexpr std::size_t SPEEDS = 120;
  for (;;) {
    ChatteringCut cut;
    RegenerativeSystem& s = cut.system;
    s.teeth = 2 + static_cast<int>(uniform(0.0, 4.0));
    const double arcs[][2] = {{0, 180}, {0, 90}, {90, 180}, {120, 180}, {0, 60}};
    const auto arc = static_cast<std::size_t>(uniform(0.0, 5.0));
    s.entry = units::radFromDeg(arcs[arc][0]);
    s.exit = units::radFromDeg(arcs[arc][1]);
    s.kt = uniform(600.0, 2200.0) * 1e6;
    s.kr = s.kt * uniform(0.2, 0.6);
    const double base = uniform(450.0, 1600.0);
    for (std::size_t axis = 0; axis < 2; ++axis)
      for (int k = 0; k < 2; ++k) {
        SystemMode mode;
        mode.frequency = base * uniform(0.9, 1.1) * (k == 0 ? 1.0 : uniform(1.3, 2.5));
        mode.damping_ratio = uniform(0.01, 0.05);
        const double stiffness = (k == 0 ? 1.0 : uniform(1.5, 6.0)) * uniform(5e6, 40e6);
        const double gain = units::TWO_PI * mode.frequency / std::sqrt(stiffness);
        mode.input[axis] = mode.output[axis] = gain;
        s.modes.push_back(mode);
      }
    cut.low = units::radPerSecFromRpm(60.0 * base / (s.teeth * uniform(5.0, 9.0)));
    cut.high = cut.low * uniform(2.5, 6.0);
    std::vector<double> speeds;
    for (std::size_t k = 0; k < SPEEDS; ++k)
      speeds.push_back(cut.low * std::pow(cut.high / cut.low, static_cast<double>(k) / (SPEEDS - 1)));
    const auto solver = makeFloquetSolver(Method::collocation, s, SolverOptions::ofManyPoints());
    std::vector<double> limits;
    for (const Limit& limit : solver->limits(speeds, MAX_DEPTH)) limits.push_back(limit.depth);
    std::vector<double> sorted = limits;
    std::sort(sorted.begin(), sorted.end());
    cut.stable_share = uniform(0.05, 0.4);
    cut.depth = sorted[static_cast<std::size_t>((1.0 - cut.stable_share) * (SPEEDS - 1))];
    if (!std::isfinite(cut.depth) || cut.depth < 1.05 * sorted.front()) continue;
    cut.depth *= 0.999;  // the speed of this limit is stable
    for (int tries = 0; tries < 100; ++tries) {
      const auto at = static_cast<std::size_t>(uniform(0.0, SPEEDS));
      if (limits[at] > 0.98 * cut.depth) continue;
      cut.speed = speeds[at];
      return cut;
    }
  }
}

Hearing::Hearing(const ChatteringCut& cut, std::uint64_t seed)
    : cut_(cut), solver_(makeFloquetSolver(Method::collocation, cut.system)), random_(seed) {
}

HeardCut Hearing::at(double speed) {
  const auto here = solver_->at(speed);
  const auto [multiplier, frequency] = here->motion(cut_.depth);
  std::normal_distribution<double> normal;
  const double heard = std::abs(frequency) * (1.0 + HEARD_ERROR * normal(random_));
  HeardCut cut;
  cut.speed = speed;
  if (multiplier.radius() > 1.0) cut.frequency = heard;
  return cut;
}

Tries bySearch(const ChatteringCut& cut, std::uint64_t seed, int most) {
  Hearing hearing(cut, seed);
  SpeedSearch search(cut.system.teeth, cut.low, cut.high);
  search.heard(hearing.at(cut.speed));
  Tries tries;
  while (!tries.stable && static_cast<int>(tries.speeds.size()) < most) {
    const SpeedProposal next = search.next();
    tries.speeds.push_back(next.speed);
    tries.stated.push_back(next.stable);
    const HeardCut heard = hearing.at(next.speed);
    tries.stable = !heard.frequency;
    search.heard(heard);
  }
  return tries;
}

Tries byRule(const ChatteringCut& cut, std::uint64_t seed, int most, bool nearest) {
  Hearing hearing(cut, seed);
  HeardCut last = hearing.at(cut.speed);
  std::vector<double> tried{cut.speed};
  Tries tries;
  while (!tries.stable && static_cast<int>(tries.speeds.size()) < most) {
    double chosen = std::numeric_limits<double>::quiet_NaN(),
           distance = std::numeric_limits<double>::infinity();
    for (int k = 1; k < 200; ++k) {
      const double speed = units::TWO_PI * *last.frequency / (cut.system.teeth * k);
      if (speed < cut.low || speed > cut.high || wasTried(tried, speed)) continue;
      const double off = nearest ? std::abs(std::log(speed / last.speed)) : -speed;
      if (off >= distance) continue;
      distance = off;
      chosen = speed;
    }
    if (std::isnan(chosen)) break;  // the rule has no further speed
    tries.speeds.push_back(chosen);
    tries.stated.push_back(std::numeric_limits<double>::quiet_NaN());
    tried.push_back(chosen);
    last = hearing.at(chosen);
    tries.stable = !last.frequency;
  }
  return tries;
}

}  // namespace smartmill::stability
