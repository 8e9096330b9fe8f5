#include "smartmill_core/modal/hit_check.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <string>

#include "clipping.h"
#include "free_decay.h"
#include "hit_channel.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/modal/impact_analysis.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/signal/window.h"

namespace smartmill {
namespace {

using Complex = std::complex<double>;

constexpr std::size_t LEAST_SAMPLES = 2 * LEAST_QUIET_SAMPLES;

std::size_t longestRun(const std::vector<double>& values, double least) {
  std::size_t longest = 0, run = 0;
  for (std::size_t i = 1; i < values.size(); ++i) {
    run = values[i] == values[i - 1] && std::abs(values[i]) > least ? run + 1 : 0;
    longest = std::max(longest, run);
  }
  return longest + 1;
}

/// Level of the record's last fifth with a Hann window, under which ringing has no mean; minus the level that
/// ringing can cause.
double endLevel(const std::vector<double>& values, double ringing_share) {
  const std::size_t n = values.size() / 5, first = values.size() - n;
  const std::vector<double> window = hannWindow(n);
  double sum = 0.0, weights = 0.0, squares = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    sum += window[i] * values[first + i];
    weights += window[i];
  }
  const double level = sum / weights;
  for (std::size_t i = 0; i < n; ++i) squares += std::pow(values[first + i] - level, 2);
  const double rings = ringing_share * std::sqrt(squares / static_cast<double>(n));
  return std::copysign(std::max(0.0, std::abs(level) - rings), level);
}

/// Faults of a single hit, whose channels have one length and are finite.
class SingleHitCheck {
 public:
  SingleHitCheck(const Hit& hit, const HitCheckOptions& options)
      : hit_(hit),
        options_(options),
        limits_(options.limits),
        force_(hitChannel(hit.force, hit.pre_trigger)),
        response_(hitChannel(hit.response, hit.pre_trigger)),
        after_(contactEnd(force_) + 2) {}

  HitFault fault() const {
    std::string reason = weak();
    if (!reason.empty()) return {reason, false};
    reason = outOfRange();
    if (reason.empty()) reason = badData();
    if (!reason.empty()) return {reason, true};
    reason = secondHit();
    if (!reason.empty()) return {reason, false};
    for (const std::string& found :
         {brokenPulse(), spike(force_, "force", after_, force_.values.size()),
          spike(response_, "response", 0, hit_.pre_trigger),
          spike(response_, "response", after_, response_.values.size()), lateBump(), decayDeviation()}) {
      if (!found.empty()) return {found, true};
    }
    return {options_.high > 0.0 ? dull() : "", false};
  }

 private:
  std::string outOfRange() const {
    for (const double v : hit_.response) {
      if (options_.response_range > 0.0 && std::abs(v) >= options_.response_range)
        return formatted("the response is clipped: %.3f reaches the range %.3f", v, options_.response_range);
    }
    return "";
  }

  /// A rise of the force after it has fallen from the main peak, or before the peak.
  std::string secondHit() const {
    const auto top = std::max_element(force_.values.begin(), force_.values.end()) - force_.values.begin();
    const double peak = force_.values[static_cast<std::size_t>(top)];
    const double rise = std::max(options_.second_hit_share * peak, limits_.above_noise * force_.noise);
    const auto least_distance = static_cast<std::ptrdiff_t>(limits_.soonest * hit_.sample_rate);
    for (const int direction : {1, -1}) {
      double lowest = peak;
      for (std::ptrdiff_t i = top; i >= 0 && i < static_cast<std::ptrdiff_t>(force_.values.size());
           i += direction) {
        const double f = force_.values[static_cast<std::size_t>(i)];
        lowest = std::min(lowest, std::max(f, 0.0));
        if (f - lowest > rise && std::abs(i - top) >= least_distance) {
          return formatted("double hit: the force rises again by %.0f %% of its peak, %.2f ms %s it",
                           100.0 * (f - lowest) / peak,
                           1e3 * static_cast<double>(std::abs(i - top)) / hit_.sample_rate,
                           direction > 0 ? "after" : "before");
        }
      }
    }
    return "";
  }

  /// A sample that deviates from both neighbours, more than others around it.
  std::string spike(const HitChannel& c, const char* name, std::size_t from, std::size_t to) const {
    std::vector<double> off(c.values.size(), 0.0);
    for (std::size_t i = 1; i + 1 < c.values.size(); ++i)
      off[i] = std::abs(c.values[i] - 0.5 * (c.values[i - 1] + c.values[i + 1]));
    for (std::size_t i = std::max(limits_.near, from); i + limits_.near < std::min(c.values.size(), to);
         ++i) {
      if (off[i] < std::max(limits_.spike_share * c.largest, limits_.above_noise * c.noise)) continue;
      // Its neighbours' deviations depend on it, so that they are left out.
      std::vector<double> about;
      for (std::size_t j = i - limits_.near; j <= i + limits_.near; ++j) {
        if (j + 1 < i || j > i + 1) about.push_back(off[j]);
      }
      if (off[i] > limits_.spike * percentile(about, 0.8))
        return formatted("dropout: sample %zu of the %s deviates from its neighbours", i, name);
    }
    return "";
  }

  /// A contact rises and falls once: one or two samples that drop out of it, or a single one far above it,
  /// are faults of the cable.
  std::string brokenPulse() const {
    const std::vector<double>& f = force_.values;
    const auto top = static_cast<std::size_t>(std::max_element(f.begin(), f.end()) - f.begin());
    const double least = std::max(limits_.notch_share * f[top], limits_.above_noise * force_.noise);
    for (std::size_t i = 1; i + 2 < f.size(); ++i) {
      if (std::min(f[i - 1], std::max(f[i + 1], f[i + 2])) - f[i] > least)
        return formatted("dropout: sample %zu of the force drops during the contact", i);
    }
    const double neighbour =
        top > 0 && top + 2 < f.size() ? std::max({f[top - 1], f[top + 1], f[top + 2]}) : f[top];
    if (f[top] > limits_.lone_top * neighbour)
      return formatted("dropout: sample %zu of the force deviates from its neighbours", top);
    return "";
  }

  std::string baseline(const HitChannel& c, const char* name) const {
    const double share = endLevel(c.values, limits_.ringing_share) / c.largest;
    if (std::abs(share) <= limits_.drift_share) return "";
    return formatted("baseline: the %s ends at %.1f %% of its largest value, expected zero", name,
                     100.0 * share);
  }

  /// The ringing rises again: by a large factor, or by a smaller one with a deviation from its prediction
  /// (beating modes are predicted).
  std::string lateBump() const {
    const auto block = static_cast<std::size_t>(limits_.block * hit_.sample_rate);
    const std::size_t blocks = (response_.values.size() - after_) / block;
    double loudest = 0.0, softest = INFINITY;
    for (std::size_t b = 0; b < blocks; ++b) {
      const std::size_t begin = after_ + b * block;
      double level = 0.0;
      for (std::size_t i = begin; i < begin + block; ++i)
        level = std::max(level, std::abs(response_.values[i]));
      loudest = std::max(loudest, level);
      const bool clear = level > std::max({limits_.bump * softest, limits_.bump_share * loudest,
                                           limits_.above_noise * response_.noise});
      const bool some = level > std::max({limits_.rise * softest, limits_.rise_share * loudest,
                                          limits_.above_noise * response_.noise});
      if (clear || (some && unpredictedRise(response_.values, after_, begin, begin + block, response_.noise,
                                            limits_.decay) > limits_.foreign))
        return formatted("late bump: %.0f ms after the hit the response rises again by a factor %.1f",
                         1e3 * static_cast<double>(b * block) / hit_.sample_rate, level / softest);
      softest = std::min(softest, level);
    }
    return "";
  }

  std::string decayDeviation() const {
    const FreeDecayBreak found = freeDecayBreak(response_.values, after_, response_.noise, limits_.decay);
    if (found.sample == 0) return "";
    return formatted(
        found.sudden
            ? "dropout: sample %zu of the response deviates from its decay by %.0f %%"
            : "late bump: near sample %zu the response deviates from the prediction of its decay (%.1f %%)",
        found.sample, 100.0 * found.size / response_.largest);
  }

  std::string dull() const {
    std::vector<double> force = force_.values;
    const std::vector<double> window = impactWindow(force);  // excludes noise outside the hit
    for (std::size_t i = 0; i < force.size(); ++i) force[i] *= window[i];
    const std::vector<Complex> spectrum = fourier(force);
    const std::vector<double> lines = fourierFrequencies(force.size(), hit_.sample_rate);
    double largest = 0.0;
    for (const Complex& s : spectrum) largest = std::max(largest, std::abs(s));
    for (std::size_t k = 0; k < lines.size() && lines[k] <= options_.high; ++k) {
      if (std::abs(spectrum[k]) < limits_.dull * largest)
        return formatted("dull hit: at %.0f Hz the force has %.1f %% of its largest line", lines[k],
                         100.0 * std::abs(spectrum[k]) / largest);
    }
    return "";
  }

  /// Faults of the record, independent of the hit itself.
  std::string badData() const {
    if (clipped(force_, false, limits_.clipping))
      return formatted("the force is clipped at %.1f N", force_.largest);
    if (clipped(response_, true, limits_.clipping)) return "the response is clipped";
    if (longestRun(response_.values, 0.02 * response_.largest) >= limits_.stuck)
      return "stuck: the response repeats one value";
    if (longestRun(force_.values, 0.02 * force_.largest) >= limits_.stuck)
      return "stuck: the force repeats one value";
    for (const auto& [channel, name] : {std::pair(&force_, "force"), std::pair(&response_, "response")}) {
      const std::string reason = baseline(*channel, name);
      if (!reason.empty()) return reason;
    }
    return "";
  }

  std::string weak() const {
    const double peak = *std::max_element(force_.values.begin(), force_.values.end());
    if (peak < options_.weak_force)
      return formatted("weak hit: peak %.1f N, expected at least %.1f N", peak, options_.weak_force);
    if (!(peak > limits_.clear * force_.noise))
      return formatted("weak hit: peak %.2f, noise of the force %.2f", peak, force_.noise);
    if (!(response_.largest > limits_.clear * response_.noise))
      return formatted("weak hit: the response's largest is %.3g, its noise %.3g", response_.largest,
                       response_.noise);
    return "";
  }

  const Hit& hit_;
  const HitCheckOptions& options_;
  const HitLimits& limits_;
  HitChannel force_, response_;
  std::size_t after_;  // first sample of the free decay
};

}  // namespace

HitFault hitFault(const Hit& hit, const HitCheckOptions& options) {
  if (hit.force.empty() || hit.force.size() != hit.response.size())
    return {"the record is empty or its channels differ in length", true};
  if (hit.force.size() < LEAST_SAMPLES)
    return {formatted("the record has %zu samples, expected at least %zu", hit.force.size(), LEAST_SAMPLES),
            true};
  const std::size_t bad = std::min(firstNotFinite(hit.force), firstNotFinite(hit.response));
  if (bad < hit.force.size()) return {"sample " + std::to_string(bad) + " is not a number", true};
  return SingleHitCheck(hit, options).fault();
}

std::vector<HitFault> checkHits(const std::vector<Hit>& hits, const HitCheckOptions& options) {
  std::vector<HitFault> faults;
  std::vector<bool> usable;
  for (const Hit& hit : hits) {
    faults.push_back(hitFault(hit, options));
    usable.push_back(faults.back().text.empty());
  }
  const std::vector<HitFault> relative = faultsAmongHits(hits, usable, options.limits.comparison);
  for (std::size_t h = 0; h < hits.size(); ++h) {
    if (usable[h]) faults[h] = relative[h];
  }
  return faults;
}

}  // namespace smartmill
