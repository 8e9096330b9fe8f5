#include "smartmill_stability/chart/what_if.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <future>

#include "smartmill_core/require.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

constexpr double NO_LIMIT = std::numeric_limits<double>::infinity();

/// First losses at the speeds of a chart, one after another, each from what its neighbours know.
class Following {
 public:
  Following(const FloquetSolver& solver, const std::vector<double>& speeds, double max_depth)
      : solver_(solver), max_depth_(max_depth), speeds_(speeds) {
    limit_.spindle_speed = speeds;
    limit_.depth.assign(speeds.size(), NO_LIMIT);
    limit_.chatter_frequency.assign(speeds.size(), std::numeric_limits<double>::quiet_NaN());
  }

  StabilityLimit run() {
    constexpr std::size_t STRIDE = 8;
    solve(0);
    for (std::size_t a = 0; a + 1 < speeds_.size();) {
      const std::size_t b = std::min(a + STRIDE, speeds_.size() - 1);
      solve(b);
      fill(a, b);
      a = b;
    }
    return std::move(limit_);
  }

 private:
  void solve(std::size_t i) {
    const Limit found = solver_.limit(speeds_[i], max_depth_);
    limit_.depth[i] = found.depth;
    limit_.chatter_frequency[i] = found.frequency;
  }

  double between(std::size_t a, std::size_t b, std::size_t i, const std::vector<double>& values) const {
    const double share = (speeds_[i] - speeds_[a]) / (speeds_[b] - speeds_[a]);
    return values[a] + share * (values[b] - values[a]);
  }

  void fill(std::size_t a, std::size_t b) {
    constexpr double STRAIGHT = 0.02;
    if (b - a < 2) return;
    const std::size_t middle = (a + b) / 2;
    const double depth = between(a, b, middle, limit_.depth);
    const double frequency = between(a, b, middle, limit_.chatter_frequency);
    // Beside a jump of the frequency another lobe begins: what the neighbours say is no guess there.
    const bool known = std::isfinite(depth) &&
                       std::abs(limit_.chatter_frequency[a] - limit_.chatter_frequency[b]) < 0.03 * frequency;
    if (!known || !follow(middle, depth)) solve(middle);
    const bool straight = known && std::abs(limit_.depth[middle] - depth) <= STRAIGHT * depth &&
                          std::abs(limit_.chatter_frequency[middle] - frequency) <= STRAIGHT * frequency;
    if (!straight) {
      fill(a, middle);
      fill(middle, b);
      return;
    }
    for (const auto& [from, to] : {std::pair{a, middle}, {middle, b}}) {
      for (std::size_t i = from + 1; i < to; ++i) {
        limit_.depth[i] = between(from, to, i, limit_.depth);
        limit_.chatter_frequency[i] = between(from, to, i, limit_.chatter_frequency);
      }
    }
  }

  /// @return false: the crossing is not near the guess
  bool follow(std::size_t i, double guess) {
    constexpr double REACH = 0.04, TOLERANCE = 2e-3;
    constexpr int MOST = 6;
    const auto here = solver_.at(speeds_[i]);
    const auto logRadius = [&](double d) { return std::log(std::max(1e-300, here->multiplier(d).radius())); };
    double low = guess, f_low = logRadius(guess), high = guess, f_high = f_low;
    for (int k = 0; k < MOST && f_low > 0.0; ++k) {
      high = low;
      f_high = f_low;
      low *= 1.0 - REACH * (1 << k);
      if (low <= 0.0) return false;
      f_low = logRadius(low);
    }
    for (int k = 0; k < MOST && f_high <= 0.0; ++k) {
      low = high;
      f_low = f_high;
      high *= 1.0 + REACH * (1 << k);
      if (high > max_depth_) return false;
      f_high = logRadius(high);
    }
    if (f_low > 0.0 || f_high <= 0.0) return false;
    double depth = low;
    for (int k = 0; k < 2 * MOST && high - low > TOLERANCE * high; ++k) {
      depth = std::clamp((low * f_high - high * f_low) / (f_high - f_low), low + 0.1 * (high - low),
                         high - 0.1 * (high - low));
      const double f = logRadius(depth);
      (f > 0.0 ? high : low) = depth;
      (f > 0.0 ? f_high : f_low) = f;
    }
    limit_.depth[i] = (low * f_high - high * f_low) / (f_high - f_low);
    limit_.chatter_frequency[i] = here->chatterFrequency(high);
    return true;
  }

  const FloquetSolver& solver_;
  double max_depth_;
  const std::vector<double>& speeds_;
  StabilityLimit limit_;
};

}  // namespace

void WhatIf::validate() const {
  const auto optional = [](const char* key, double value, const Range& range, const char* unit) {
    if (!std::isnan(value)) require(key, value, range, unit);
  };
  require("teeth", teeth, Range::closed(0, 20));
  optional("helix", helix, Range::openHigh(0.0, units::radFromDeg(80.0)), "rad");
  optional("entry_angle", entry, Range::openHigh(0.0, units::TWO_PI), "rad");
  optional("exit_angle", exit, Range::openLow(0.0, units::TWO_PI), "rad");
  optional("feed_per_tooth", feed_per_tooth, Range::openLow(0.0, 0.01), "m");
  optional("overhang", overhang, Range::closed(0.25, 4.0), "1");
  optional("axial_depth", axial_depth, Range::openLow(0.0, 1.0), "m");
  require("speeds", speeds, Range::closed(0, 1000));
  require(speeds != 1, "speeds", speeds, "0 or at least 2");
}

// With q of unit modal mass the compliance of a mode is input x output / w^2.
std::vector<SystemMode> withOverhang(std::vector<SystemMode> modes, double overhang) {
  const double frequency = 1.0 / (overhang * overhang);
  const double gain = std::sqrt(overhang * overhang * overhang) * frequency;
  for (SystemMode& mode : modes) {
    mode.frequency *= frequency;
    for (std::size_t a = 0; a < 2; ++a) {
      mode.input[a] *= gain;
      mode.output[a] *= gain;
    }
  }
  return modes;
}

StabilityLimit followedLimits(const FloquetSolver& solver, const std::vector<double>& speeds,
                              double max_depth) {
  // Two halves at once: a solver is not changed by what it solves.
  const std::size_t half = speeds.size() / 2;
  const std::vector<double> slow(speeds.begin(), speeds.begin() + static_cast<std::ptrdiff_t>(half));
  const std::vector<double> fast(speeds.begin() + static_cast<std::ptrdiff_t>(half), speeds.end());
  if (slow.empty()) return Following(solver, fast, max_depth).run();
  auto other = std::async(std::launch::async, [&] { return Following(solver, slow, max_depth).run(); });
  const StabilityLimit high = Following(solver, fast, max_depth).run();
  StabilityLimit limit = other.get();
  limit.spindle_speed = speeds;
  limit.depth.insert(limit.depth.end(), high.depth.begin(), high.depth.end());
  limit.chatter_frequency.insert(limit.chatter_frequency.end(), high.chatter_frequency.begin(),
                                 high.chatter_frequency.end());
  return limit;
}

int dominantMode(const std::vector<SystemMode>& modes, double frequency) {
  int found = -1;
  double largest = 0.0;
  if (std::isnan(frequency)) return found;
  for (std::size_t k = 0; k < modes.size(); ++k) {
    const auto h = receptance({modes[k]}, frequency);
    const double answer = std::sqrt(std::norm(h[0]) + std::norm(h[1]) + std::norm(h[2]) + std::norm(h[3]));
    if (!(answer > largest)) continue;
    largest = answer;
    found = static_cast<int>(k);
  }
  return found;
}

}  // namespace smartmill::stability
