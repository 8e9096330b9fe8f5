#include "smartmill_hammer/analysis/hit_judge.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdarg>
#include <cstdio>

#include "smartmill_core/modal/impact_analysis.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace hammer {
namespace {

using Complex = std::complex<double>;

/// Samples before the hit that give a baseline and noise worth having.
constexpr std::size_t LEAST_QUIET = 48;
/// Peak over noise of a hit that is one.
constexpr double CLEAR_HIT = 10.0;
/// Noise, in standard deviations, above which a rise is one.
constexpr double ABOVE_NOISE = 8.0;
/// A second hit comes no sooner [s].
constexpr double SOONEST_SECOND = 0.4e-3;
constexpr std::size_t CLIPPED_RUN = 4, STUCK_RUN = 12;
/// A sample off its neighbours' line by so many times what is usual about it, and by this share of the
/// largest.
constexpr double SPIKE = 25.0, SPIKE_SHARE = 0.15;
constexpr double DRIFT_SHARE = 0.03;
/// A late block louder than an earlier one by this factor, and above this share of the loudest.
constexpr double BUMP = 4.0, BUMP_SHARE = 0.25;
constexpr std::size_t BLOCKS = 20;
/// The force's spectrum at the end of the asked band, of its largest.
constexpr double DULL = 0.05;
/// Gain beside that of the other hits, and shift between the channels [samples].
constexpr double GAIN_JUMP = 0.1, SKEW = 0.35;

std::string text(const char* format, ...) __attribute__((format(printf, 1, 2)));
std::string text(const char* format, ...) {
  char line[200];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(line, sizeof line, format, arguments);
  va_end(arguments);
  return line;
}

struct Quiet {
  double level = 0.0, noise = 0.0, scatter = 0.0;
};

/// Baseline and noise: before the hit, or of the record's end where it begins with the hit.
Quiet quietOf(const std::vector<double>& values, std::size_t before) {
  const std::size_t n = before - before / 4;
  const auto first = values.begin();
  const std::vector<double> part =
      n >= LEAST_QUIET
          ? std::vector<double>(first, first + static_cast<std::ptrdiff_t>(n))
          : std::vector<double>(values.end() - static_cast<std::ptrdiff_t>(values.size() / 10), values.end());
  if (part.size() < 2) return {};
  return {mean(part), noiseUnderRinging(part), standardDeviation(part)};
}

std::size_t longestRun(const std::vector<double>& values, double least) {
  std::size_t longest = 0, run = 0;
  for (std::size_t i = 1; i < values.size(); ++i) {
    run = values[i] == values[i - 1] && std::abs(values[i]) > least ? run + 1 : 0;
    longest = std::max(longest, run);
  }
  return longest + 1;
}

/// A rise of the force after it had fallen from the main peak, or before it.
std::string secondHit(const std::vector<double>& force, double peak, double noise, double rate,
                      double share) {
  const auto top = std::max_element(force.begin(), force.end()) - force.begin();
  const double rise = std::max(share * peak, ABOVE_NOISE * noise);
  const auto soonest = static_cast<std::ptrdiff_t>(SOONEST_SECOND * rate);
  for (const int way : {1, -1}) {
    double lowest = peak;
    for (std::ptrdiff_t i = top; i >= 0 && i < static_cast<std::ptrdiff_t>(force.size()); i += way) {
      const double f = force[static_cast<std::size_t>(i)];
      lowest = std::min(lowest, std::max(f, 0.0));
      if (f - lowest > rise && std::abs(i - top) >= soonest) {
        return text("double hit: the force rises again by %.0f %% of its peak, %.2f ms %s it",
                    100.0 * (f - lowest) / peak, 1e3 * static_cast<double>(std::abs(i - top)) / rate,
                    way > 0 ? "after" : "before");
      }
    }
  }
  return "";
}

std::string spike(const std::vector<double>& values, double noise) {
  constexpr std::size_t NEAR = 12;
  double largest = 0.0;
  for (const double v : values) largest = std::max(largest, std::abs(v));
  std::vector<double> off(values.size(), 0.0);
  for (std::size_t i = 1; i + 1 < values.size(); ++i)
    off[i] = std::abs(values[i] - 0.5 * (values[i - 1] + values[i + 1]));
  for (std::size_t i = NEAR; i + NEAR < values.size(); ++i) {
    if (off[i] < std::max(SPIKE_SHARE * largest, ABOVE_NOISE * noise)) continue;
    // Its neighbours lean on it, so that they and it are left out.
    std::vector<double> about;
    for (std::size_t j = i - NEAR; j <= i + NEAR; ++j) {
      if (j + 1 < i || j > i + 1) about.push_back(off[j]);
    }
    if (off[i] > SPIKE * percentile(about, 0.8))
      return text("dropout: sample %zu of the response stands alone", i);
  }
  return "";
}

std::string lateBump(const std::vector<double>& response, std::size_t from, double noise) {
  const std::size_t block = (response.size() - from) / BLOCKS;
  if (block < 16) return "";
  double loudest = 0.0, softest = INFINITY;
  for (std::size_t b = 0; b < BLOCKS; ++b) {
    double sum = 0.0;
    for (std::size_t i = 0; i < block; ++i) sum += std::pow(response[from + b * block + i], 2);
    const double level = std::sqrt(sum / static_cast<double>(block));
    loudest = std::max(loudest, level);
    if (level > std::max({BUMP * softest, BUMP_SHARE * loudest, ABOVE_NOISE * noise}))
      return text("late bump: the response swells again in part %zu of %zu", b + 1, BLOCKS);
    softest = std::min(softest, level);
  }
  return "";
}

std::string dull(const std::vector<double>& force, double rate, double high) {
  const std::vector<Complex> spectrum = fourier(force);
  const std::vector<double> lines = fourierFrequencies(force.size(), rate);
  double largest = 0.0;
  for (const Complex& s : spectrum) largest = std::max(largest, std::abs(s));
  for (std::size_t k = 0; k < lines.size() && lines[k] <= high; ++k) {
    if (std::abs(spectrum[k]) < DULL * largest)
      return text("dull hit: at %.0f Hz the force has %.1f %% of its largest line", lines[k],
                  100.0 * std::abs(spectrum[k]) / largest);
  }
  return "";
}

std::vector<double> without(std::vector<double> values, double level) {
  for (double& v : values) v -= level;
  return values;
}

}  // namespace

std::string hitReason(const Hit& hit, const HitJudgeOptions& options) {
  // What makes any record useless is the core's; second hits are looked for more closely here.
  const HitFault fault = hitFault(hit, {std::max(options.weak_force, 1e-9), 1.0, options.response_range});
  if (!fault.text.empty()) return fault.text;
  const Quiet still = quietOf(hit.force, hit.pre_trigger), calm = quietOf(hit.response, hit.pre_trigger);
  const bool rings = calm.scatter > 3.0 * calm.noise;  // then its mean is no baseline
  const std::vector<double> force = without(hit.force, still.level),
                            response = without(hit.response, rings ? 0.0 : calm.level);
  const double peak = *std::max_element(force.begin(), force.end());
  if (!(peak > CLEAR_HIT * still.noise))
    return text("weak hit: peak %.2f, noise of the force %.2f", peak, still.noise);
  double largest = 0.0;
  for (const double r : response) largest = std::max(largest, std::abs(r));
  if (!(largest > CLEAR_HIT * calm.noise))
    return text("weak hit: the response's largest is %.3g, its noise %.3g", largest, calm.noise);
  if (longestRunAtExtreme(hit.response) >= CLIPPED_RUN) return "the response is clipped";
  if (longestRun(response, 0.02 * largest) >= STUCK_RUN) return "stuck: the response repeats one value";
  if (longestRun(force, 0.02 * peak) >= STUCK_RUN) return "stuck: the force repeats one value";
  const std::string second = secondHit(force, peak, still.noise, hit.sample_rate, options.second_hit_share);
  if (!second.empty()) return second;
  const Quiet end = quietOf(force, 0);
  if (std::abs(end.level) > DRIFT_SHARE * peak)
    return text("baseline: the force ends %.1f %% of its peak off", 100.0 * end.level / peak);
  const Quiet response_end = quietOf(response, 0);
  // A slow mode that still rings has a mean of its own.
  if (std::abs(response_end.level) > std::max(3.0 * DRIFT_SHARE * largest, 2.0 * response_end.scatter))
    return text("baseline: the response ends %.1f %% of its largest off",
                100.0 * response_end.level / largest);
  for (const std::string& reason :
       {spike(response, calm.noise), lateBump(response, hit.pre_trigger, calm.noise)}) {
    if (!reason.empty()) return reason;
  }
  return options.high > 0.0 ? dull(force, hit.sample_rate, options.high) : "";
}

std::vector<std::string> reasonsBeside(const std::vector<Hit>& hits, const std::vector<bool>& usable) {
  std::vector<std::string> reasons(hits.size());
  std::vector<std::vector<Complex>> force(hits.size()), response(hits.size());
  std::vector<std::size_t> members;
  for (std::size_t h = 0; h < hits.size(); ++h) {
    if (!usable[h]) continue;
    if (hits[h].force.size() != hits[members.empty() ? h : members.front()].force.size()) return reasons;
    const auto spectrum = [&](const std::vector<double>& values) {
      return fourier(without(values, quietOf(values, hits[h].pre_trigger).level));
    };
    force[h] = spectrum(hits[h].force);
    response[h] = spectrum(hits[h].response);
    members.push_back(h);
  }
  if (members.size() < 3) return reasons;
  const std::size_t lines = force[members.front()].size();
  double strongest = 0.0;
  for (std::size_t k = 1; k < lines; ++k)
    strongest = std::max(strongest, std::abs(force[members.front()][k]));
  for (const std::size_t h : members) {
    // By how much the response differs from what the others' FRF makes of the force: gain, and a phase that
    // grows with frequency.
    std::vector<double> gains, turns;
    for (std::size_t k = 1; k < lines; ++k) {
      Complex cross;
      double power = 0.0;
      for (const std::size_t o : members) {
        if (o == h) continue;
        cross += std::conj(force[o][k]) * response[o][k];
        power += std::norm(force[o][k]);
      }
      if (std::abs(force[h][k]) < 0.2 * strongest || !(std::abs(cross) > 0.0)) continue;
      const Complex ratio = response[h][k] / (force[h][k] * cross / power);
      gains.push_back(std::abs(ratio));
      turns.push_back(std::arg(ratio) /
                      (units::TWO_PI * static_cast<double>(k) / static_cast<double>(2 * (lines - 1))));
    }
    if (gains.size() < 16) continue;
    const double gain = median(gains);
    // Low lines turn little: the upper half of them tells the shift.
    const double shift = median({turns.begin() + static_cast<std::ptrdiff_t>(turns.size() / 2), turns.end()});
    if (std::abs(gain - 1.0) > GAIN_JUMP) {
      reasons[h] = text("gain jump: %.2f of that of the other hits", gain);
    } else if (std::abs(shift) > SKEW) {
      reasons[h] =
          text("trigger skew: the channels are shifted by %.2f samples beside the other hits", -shift);
    }
  }
  return reasons;
}

}  // namespace hammer
}  // namespace smartmill
