#include "smartmill_core/modal/hit_check.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <string>

#include "free_decay.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/modal/impact_analysis.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/signal/window.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

using Complex = std::complex<double>;

/// Fewest samples before the hit for baseline and noise.
constexpr std::size_t LEAST_QUIET = 48;
/// Fewest samples of a record.
constexpr std::size_t LEAST_SAMPLES = 2 * LEAST_QUIET;
/// Least ratio of peak to noise.
constexpr double CLEAR_HIT = 10.0;
/// Least rise, in standard deviations of the noise.
constexpr double ABOVE_NOISE = 8.0;
/// [s] Least time between two hits.
constexpr double SOONEST_SECOND = 0.4e-3;
constexpr std::size_t CLIPPED = 3, STUCK_RUN = 8, CROWD = 8, CROWDED = 3, MIRRORED = 5, PILED = 2;
constexpr double FLAT = 3.0;
/// Width of the bands in which samples at the top are counted: in standard deviations of the noise, and as
/// share of the largest value.
constexpr double ROUND = 1.35, SHARP = 2.5, VERY_SHARP = 6.0;
constexpr double FLAT_NOISE = 5.0, FLAT_SHARE = 0.002, TOP_SHARE = 0.02, FINE_STEP = 3e-6;
/// Deviation of a sample from its neighbours, as multiple of the usual deviation around it and as share of
/// the largest value.
constexpr double SPIKE = 25.0, SPIKE_SHARE = 0.12;
/// Depth of a notch in the contact, of the peak; height of a false peak over its neighbours.
constexpr double NOTCH_SHARE = 0.15, LONE_TOP = 2.5;
/// Level at the end, of the largest value; share of the remaining ringing that may appear as a level.
constexpr double DRIFT_SHARE = 0.03, RINGING_SHARE = 0.06;
/// [s] Blocks over which the maximum of the response is taken. A block is a late bump when it exceeds an
/// earlier one by a large factor and a share of the largest; or by a smaller factor, with an unpredicted
/// power of this multiple of the earlier one.
constexpr double BLOCK = 5e-3;
constexpr double BUMP = 5.0, BUMP_SHARE = 0.25, RISE = 1.5, RISE_SHARE = 0.06, FOREIGN = 4.0;
/// Least force spectrum at the end of the required band, of its maximum.
constexpr double DULL = 0.05;
/// Largest relative deviation of the gain from that of the other hits, and shift between the channels
/// [samples].
constexpr double GAIN_JUMP = 0.1, SKEW = 0.35;
/// Both must also exceed this number of standard deviations by noise.
constexpr double BY_NOISE = 3.0;
/// Range and step of the shifts [samples]; lines from this share of the strongest are used.
constexpr double MOST_SKEW = 6.0, SKEW_STEP = 0.1, STRONG_FORCE = 0.2;

struct Background {
  double level = 0.0, noise = 0.0, scatter = 0.0;
};

/// Baseline and noise before the hit, or at the record's end where it begins with the hit.
Background backgroundOf(const std::vector<double>& values, std::size_t before) {
  const std::size_t n = before - before / 4;
  const auto first = values.begin();
  const std::vector<double> part =
      n >= LEAST_QUIET
          ? std::vector<double>(first, first + static_cast<std::ptrdiff_t>(n))
          : std::vector<double>(values.end() - static_cast<std::ptrdiff_t>(values.size() / 10), values.end());
  if (part.size() < 2) return {};
  return {mean(part), noiseUnderRinging(part), standardDeviation(part)};
}

/// A channel minus its baseline.
struct Channel {
  std::vector<double> values;
  double noise = 0.0, largest = 0.0;
};

Channel channelOf(const std::vector<double>& values, std::size_t before) {
  const Background background = backgroundOf(values, before);
  // Where the record begins with the hit and still rings at its end, the mean there is not a baseline.
  const bool rings = before - before / 4 < LEAST_QUIET && background.scatter > 3.0 * background.noise;
  Channel c{values, background.noise, 0.0};
  for (double& v : c.values) {
    v -= rings ? 0.0 : background.level;
    c.largest = std::max(c.largest, std::abs(v));
  }
  return c;
}

std::size_t longestRun(const std::vector<double>& values, double least) {
  std::size_t longest = 0, run = 0;
  for (std::size_t i = 1; i < values.size(); ++i) {
    run = values[i] == values[i - 1] && std::abs(values[i]) > least ? run + 1 : 0;
    longest = std::max(longest, run);
  }
  return longest + 1;
}

/// Clipped before the converter, equal within the noise: a flat around the largest sample that ends in
/// corners. Next to a round crest, however broad, each step down is larger than the one before.
bool hasFlatTop(const Channel& c, double sign) {
  const auto n = static_cast<std::ptrdiff_t>(c.values.size());
  const auto at = [&](std::ptrdiff_t i) { return sign * c.values[static_cast<std::size_t>(i)]; };
  const double width = std::max(FLAT_NOISE * c.noise, FLAT_SHARE * c.largest);
  std::ptrdiff_t top = 0;
  for (std::ptrdiff_t i = 1; i < n; ++i) top = at(i) > at(top) ? i : top;
  std::ptrdiff_t ends[2] = {top, top};
  for (const int side : {0, 1}) {
    const std::ptrdiff_t direction = side == 0 ? -1 : 1;
    while (ends[side] + 4 * direction >= 0 && ends[side] + 4 * direction < n &&
           at(top) - at(ends[side] + direction) < width)
      ends[side] += direction;
  }
  const auto length = static_cast<double>(ends[1] - ends[0] + 1);
  if (length < FLAT) return false;
  for (const int side : {0, 1}) {
    const std::ptrdiff_t direction = side == 0 ? -1 : 1, end = ends[side];
    if (end + 4 * direction < 0 || end + 4 * direction >= n) return false;
    const double second = at(end + direction) - at(end + 2 * direction),
                 third = at(end + 2 * direction) - at(end + 3 * direction);
    const double round = width * std::pow(1.0 + 4.0 / length, 2);  // fall of a parabola of this width
    const double fall = (at(top) - at(end + 2 * direction)) / round;
    if (fall < SHARP || (third > ROUND * second && fall < VERY_SHARP)) return false;
  }
  return true;
}

/// Many crests of equal height: a round crest has at most 1.4 times as many samples in a band at its top as
/// in the two below it.
bool hasEqualCrests(const Channel& c, double sign) {
  const double width = std::max(FLAT_NOISE * c.noise, FLAT_SHARE * c.largest);
  double top = 0.0;
  for (const double v : c.values) top = std::max(top, sign * v);
  std::size_t first = 0, next = 0;
  for (const double v : c.values) {
    const double depth = top - sign * v;
    first += depth < width;
    next += depth >= width && depth < 3.0 * width;
  }
  return top > 0.2 * c.largest && first >= CROWD && first >= CROWDED * next;
}

/// Clipped on both sides: an amplifier has the same range in both directions, while the crests of a decay
/// fall from one to the next. Minimum and maximum have equal magnitude, and samples accumulate there.
bool clippedOnBothSides(const Channel& c) {
  const double width = std::max(FLAT_NOISE * c.noise, FLAT_SHARE * c.largest);
  const auto [low, high] = std::minmax_element(c.values.begin(), c.values.end());
  if (std::abs(*high + *low) >= width) return false;
  std::size_t first = 0, next = 0;
  for (const double v : c.values) {
    const double depth = c.largest - std::abs(v);
    first += depth < width;
    next += depth >= width && depth < 3.0 * width;
  }
  return first >= MIRRORED && first >= PILED * next;
}

/// Number of samples equal to the largest value, of their crests, and of other samples near it.
struct Top {
  std::size_t equal = 0, below = 0, crests = 0;
};
Top topOf(const Channel& c, double sign) {
  double top = 0.0;
  for (const double v : c.values) top = std::max(top, sign * v);
  Top found;
  bool before = false;
  for (const double v : c.values) {
    const double depth = top - sign * v;
    const bool equal = depth <= 1e-9 * top;
    found.equal += equal;
    found.crests += equal && !before;
    found.below += !equal && depth < TOP_SHARE * top;
    before = equal;
  }
  return top < 0.2 * c.largest ? Top{} : found;
}

/// Resolution of the converter.
double stepOf(const std::vector<double>& values) {
  double step = INFINITY;
  for (std::size_t i = 1; i < values.size(); ++i) {
    const double d = std::abs(values[i] - values[i - 1]);
    if (d > 0.0) step = std::min(step, d);
  }
  return step;
}

/// More (nearly) equal samples at the top than a crest has: clipped by the converter or before it. With
/// coarse resolution two equal neighbours occur by chance.
bool clipped(const Channel& c, bool both_ways) {
  const bool fine = stepOf(c.values) < FINE_STEP * c.largest;
  const Top up = topOf(c, 1.0), down = both_ways ? topOf(c, -1.0) : Top{};
  for (const Top& top : {up, down}) {
    if ((top.equal >= CLIPPED && 2 * top.equal >= top.below) || (top.equal >= 2 && fine) ||
        (top.crests >= 2 && top.equal >= top.below))
      return true;
  }
  if ((up.equal >= 2 && down.equal >= 2) || hasFlatTop(c, 1.0)) return true;
  return both_ways &&
         (hasFlatTop(c, -1.0) || hasEqualCrests(c, 1.0) || hasEqualCrests(c, -1.0) || clippedOnBothSides(c));
}

/// A rise of the force after it has fallen from the main peak, or before the peak.
std::string secondHit(const Channel& force, double rate, double share) {
  const auto top = std::max_element(force.values.begin(), force.values.end()) - force.values.begin();
  const double peak = force.values[static_cast<std::size_t>(top)];
  const double rise = std::max(share * peak, ABOVE_NOISE * force.noise);
  const auto least_distance = static_cast<std::ptrdiff_t>(SOONEST_SECOND * rate);
  for (const int direction : {1, -1}) {
    double lowest = peak;
    for (std::ptrdiff_t i = top; i >= 0 && i < static_cast<std::ptrdiff_t>(force.values.size());
         i += direction) {
      const double f = force.values[static_cast<std::size_t>(i)];
      lowest = std::min(lowest, std::max(f, 0.0));
      if (f - lowest > rise && std::abs(i - top) >= least_distance) {
        return formatted("double hit: the force rises again by %.0f %% of its peak, %.2f ms %s it",
                         100.0 * (f - lowest) / peak, 1e3 * static_cast<double>(std::abs(i - top)) / rate,
                         direction > 0 ? "after" : "before");
      }
    }
  }
  return "";
}

/// A sample that deviates from both neighbours, more than others around it.
std::string spike(const Channel& c, const char* name, std::size_t from, std::size_t to) {
  constexpr std::size_t NEAR = 12;
  std::vector<double> off(c.values.size(), 0.0);
  for (std::size_t i = 1; i + 1 < c.values.size(); ++i)
    off[i] = std::abs(c.values[i] - 0.5 * (c.values[i - 1] + c.values[i + 1]));
  for (std::size_t i = std::max(NEAR, from); i + NEAR < std::min(c.values.size(), to); ++i) {
    if (off[i] < std::max(SPIKE_SHARE * c.largest, ABOVE_NOISE * c.noise)) continue;
    // Its neighbours' deviations depend on it, so that they are left out.
    std::vector<double> about;
    for (std::size_t j = i - NEAR; j <= i + NEAR; ++j) {
      if (j + 1 < i || j > i + 1) about.push_back(off[j]);
    }
    if (off[i] > SPIKE * percentile(about, 0.8))
      return formatted("dropout: sample %zu of the %s deviates from its neighbours", i, name);
  }
  return "";
}

/// A contact rises and falls once: one or two samples that drop out of it, or a single one far above it, are
/// faults of the cable.
std::string brokenPulse(const Channel& force) {
  const std::vector<double>& f = force.values;
  const auto top = static_cast<std::size_t>(std::max_element(f.begin(), f.end()) - f.begin());
  const double least = std::max(NOTCH_SHARE * f[top], ABOVE_NOISE * force.noise);
  for (std::size_t i = 1; i + 2 < f.size(); ++i) {
    if (std::min(f[i - 1], std::max(f[i + 1], f[i + 2])) - f[i] > least)
      return formatted("dropout: sample %zu of the force drops during the contact", i);
  }
  const double neighbour =
      top > 0 && top + 2 < f.size() ? std::max({f[top - 1], f[top + 1], f[top + 2]}) : f[top];
  if (f[top] > LONE_TOP * neighbour)
    return formatted("dropout: sample %zu of the force deviates from its neighbours", top);
  return "";
}

/// Level of the record's last fifth with a Hann window, under which ringing has no mean; minus the level that
/// ringing can cause.
double endLevel(const std::vector<double>& values) {
  const std::size_t n = values.size() / 5, first = values.size() - n;
  const std::vector<double> window = hannWindow(n);
  double sum = 0.0, weights = 0.0, squares = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    sum += window[i] * values[first + i];
    weights += window[i];
  }
  const double level = sum / weights;
  for (std::size_t i = 0; i < n; ++i) squares += std::pow(values[first + i] - level, 2);
  const double rings = RINGING_SHARE * std::sqrt(squares / static_cast<double>(n));
  return std::copysign(std::max(0.0, std::abs(level) - rings), level);
}

std::string baseline(const Channel& c, const char* name) {
  const double share = endLevel(c.values) / c.largest;
  if (std::abs(share) <= DRIFT_SHARE) return "";
  return formatted("baseline: the %s ends at %.1f %% of its largest value, expected zero", name,
                   100.0 * share);
}

/// First sample after the contact.
std::size_t contactEnd(const Channel& force) {
  const auto top = static_cast<std::size_t>(std::max_element(force.values.begin(), force.values.end()) -
                                            force.values.begin());
  const double touch = std::max(0.02 * force.largest, 4.0 * force.noise);
  std::size_t end = top;
  while (end + 1 < force.values.size() && force.values[end] > touch) ++end;
  return end;
}

/// The ringing rises again: by a large factor, or by a smaller one with a deviation from its prediction
/// (beating modes are predicted).
std::string lateBump(const Channel& response, std::size_t from, double rate) {
  const auto block = static_cast<std::size_t>(BLOCK * rate);
  const std::size_t blocks = (response.values.size() - from) / block;
  double loudest = 0.0, softest = INFINITY;
  for (std::size_t b = 0; b < blocks; ++b) {
    const std::size_t begin = from + b * block;
    double level = 0.0;
    for (std::size_t i = begin; i < begin + block; ++i) level = std::max(level, std::abs(response.values[i]));
    loudest = std::max(loudest, level);
    const bool clear = level > std::max({BUMP * softest, BUMP_SHARE * loudest, ABOVE_NOISE * response.noise});
    const bool some = level > std::max({RISE * softest, RISE_SHARE * loudest, ABOVE_NOISE * response.noise});
    if (clear ||
        (some && unpredictedRise(response.values, from, begin, begin + block, response.noise) > FOREIGN))
      return formatted("late bump: %.0f ms after the hit the response rises again by a factor %.1f",
                       1e3 * static_cast<double>(b * block) / rate, level / softest);
    softest = std::min(softest, level);
  }
  return "";
}

std::string decayDeviation(const Channel& force, const Channel& response) {
  const FreeDecayBreak found = freeDecayBreak(response.values, contactEnd(force) + 2, response.noise);
  if (found.sample == 0) return "";
  return formatted(
      found.sudden
          ? "dropout: sample %zu of the response deviates from its decay by %.0f %%"
          : "late bump: near sample %zu the response deviates from the prediction of its decay (%.1f %%)",
      found.sample, 100.0 * found.size / response.largest);
}

std::string dull(const Channel& channel, double rate, double high) {
  std::vector<double> force = channel.values;
  const std::vector<double> window = impactWindow(force);  // excludes noise outside the hit
  for (std::size_t i = 0; i < force.size(); ++i) force[i] *= window[i];
  const std::vector<Complex> spectrum = fourier(force);
  const std::vector<double> lines = fourierFrequencies(force.size(), rate);
  double largest = 0.0;
  for (const Complex& s : spectrum) largest = std::max(largest, std::abs(s));
  for (std::size_t k = 0; k < lines.size() && lines[k] <= high; ++k) {
    if (std::abs(spectrum[k]) < DULL * largest)
      return formatted("dull hit: at %.0f Hz the force has %.1f %% of its largest line", lines[k],
                       100.0 * std::abs(spectrum[k]) / largest);
  }
  return "";
}

/// Faults of the record, independent of the hit itself.
std::string badData(const Channel& force, const Channel& response) {
  if (clipped(force, false)) return formatted("the force is clipped at %.1f N", force.largest);
  if (clipped(response, true)) return "the response is clipped";
  if (longestRun(response.values, 0.02 * response.largest) >= STUCK_RUN)
    return "stuck: the response repeats one value";
  if (longestRun(force.values, 0.02 * force.largest) >= STUCK_RUN)
    return "stuck: the force repeats one value";
  for (const auto& [channel, name] : {std::pair(&force, "force"), std::pair(&response, "response")}) {
    const std::string reason = baseline(*channel, name);
    if (!reason.empty()) return reason;
  }
  return "";
}

std::string weak(const Channel& force, const Channel& response, double least) {
  const double peak = *std::max_element(force.values.begin(), force.values.end());
  if (peak < least) return formatted("weak hit: peak %.1f N, expected at least %.1f N", peak, least);
  if (!(peak > CLEAR_HIT * force.noise))
    return formatted("weak hit: peak %.2f, noise of the force %.2f", peak, force.noise);
  if (!(response.largest > CLEAR_HIT * response.noise))
    return formatted("weak hit: the response's largest is %.3g, its noise %.3g", response.largest,
                     response.noise);
  return "";
}

struct Lines {
  std::vector<Complex> force, response;
  double noise = 0.0;  // mean |response|^2 of a line by the sensor's noise alone
};

Lines linesOf(const Hit& hit) {
  Channel force = channelOf(hit.force, hit.pre_trigger);
  const std::vector<double> window = impactWindow(force.values);
  for (std::size_t i = 0; i < window.size(); ++i) force.values[i] *= window[i];
  const Channel response = channelOf(hit.response, hit.pre_trigger);
  return {fourier(force.values), fourier(response.values),
          static_cast<double>(response.values.size()) * response.noise * response.noise};
}

/// A hit's response relative to the one predicted from its force with the FRF of the others.
struct Comparison {
  double gain = 1.0, shift = 0.0;          ///< [1], [samples] of the response
  double gain_std = 0.0, shift_std = 0.0;  ///< by the noise
  double jump() const { return std::abs(std::log(gain)) / (GAIN_JUMP + BY_NOISE * gain_std); }
  double skew() const { return std::abs(shift) / (SKEW + BY_NOISE * shift_std); }
  double severity() const { return std::max(jump(), skew()); }
};

Comparison compareWithOthers(const std::vector<Lines>& lines, const std::vector<std::size_t>& members,
                             std::size_t h) {
  const std::vector<Complex>& force = lines[h].force;
  double strongest = 0.0, power = 0.0, slope_power = 0.0, noise = 0.0;
  const double turn = units::PI / static_cast<double>(force.size() - 1);
  for (const Complex& f : force) strongest = std::max(strongest, std::abs(f));
  std::vector<Complex> product(force.size());
  for (std::size_t k = 1; k < force.size(); ++k) {
    if (std::abs(force[k]) < STRONG_FORCE * strongest) continue;
    Complex cross;
    double squares = 0.0;
    for (const std::size_t o : members) {
      if (o == h) continue;
      cross += std::conj(lines[o].force[k]) * lines[o].response[k];
      squares += std::norm(lines[o].force[k]);
    }
    const Complex predicted = force[k] * cross / squares;
    product[k] = std::conj(predicted) * lines[h].response[k];
    // The prediction contains a share of the others' noise, which is not part of its power.
    const double of_noise = std::norm(force[k]) * lines[h].noise / squares;
    power += std::norm(predicted) - of_noise;
    slope_power += std::pow(turn * static_cast<double>(k), 2) * (std::norm(predicted) - of_noise);
    noise = std::max(noise, lines[h].noise * (1.0 + std::norm(force[k]) / squares));
  }
  if (!(power > 0.0 && slope_power > 0.0)) return {1.0, 0.0, INFINITY, INFINITY};
  // The shift of largest correlation, and the gain there.
  const auto along = [&](double shift) {
    double sum = 0.0;
    for (std::size_t k = 1; k < product.size(); ++k) {
      if (product[k] != 0.0)
        sum += (product[k] * std::polar(1.0, turn * shift * static_cast<double>(k))).real();
    }
    return sum / power;
  };
  const double gain_std = std::sqrt(0.5 * noise / power), shift_std = std::sqrt(0.5 * noise / slope_power);
  Comparison found{along(0.0), 0.0, gain_std, shift_std};
  for (double shift = -MOST_SKEW; shift <= MOST_SKEW; shift += SKEW_STEP) {
    const double gain = along(shift);
    if (gain > found.gain) found = {gain, shift, gain_std, shift_std};
  }
  found.gain = std::max(found.gain, 1e-6);
  return found;
}

}  // namespace

HitFault hitFault(const Hit& hit, const HitCheckOptions& options) {
  if (hit.force.empty() || hit.force.size() != hit.response.size())
    return {"the record is empty or its channels differ in length", true};
  if (hit.force.size() < LEAST_SAMPLES)
    return {formatted("the record has %zu samples, expected at least %zu", hit.force.size(), LEAST_SAMPLES),
            true};
  const std::size_t bad = std::min(firstNotFinite(hit.force), firstNotFinite(hit.response));
  if (bad < hit.force.size()) return {"sample " + std::to_string(bad) + " is not a number", true};
  const Channel force = channelOf(hit.force, hit.pre_trigger),
                response = channelOf(hit.response, hit.pre_trigger);
  std::string reason = weak(force, response, options.weak_force);
  if (!reason.empty()) return {reason, false};
  for (const double v : hit.response) {
    if (options.response_range > 0.0 && std::abs(v) >= options.response_range)
      return {formatted("the response is clipped: %.3f reaches the range %.3f", v, options.response_range),
              true};
  }
  reason = badData(force, response);
  if (!reason.empty()) return {reason, true};
  reason = secondHit(force, hit.sample_rate, options.second_hit_share);
  if (!reason.empty()) return {reason, false};
  for (const std::string& found :
       {brokenPulse(force), spike(force, "force", contactEnd(force) + 2, force.values.size()),
        spike(response, "response", 0, hit.pre_trigger),
        spike(response, "response", contactEnd(force) + 2, response.values.size()),
        lateBump(response, contactEnd(force) + 2, hit.sample_rate), decayDeviation(force, response)}) {
    if (!found.empty()) return {found, true};
  }
  return {options.high > 0.0 ? dull(force, hit.sample_rate, options.high) : "", false};
}

std::vector<HitFault> faultsAmongHits(const std::vector<Hit>& hits, const std::vector<bool>& usable) {
  std::vector<HitFault> faults(hits.size());
  std::vector<Lines> lines(hits.size());
  std::vector<std::size_t> members;
  for (std::size_t h = 0; h < hits.size(); ++h) {
    if (!usable[h]) continue;
    if (hits[h].force.size() != hits[members.empty() ? h : members.front()].force.size()) return faults;
    lines[h] = linesOf(hits[h]);
    members.push_back(h);
  }
  // The worst is removed first, since it affects the reference of the others.
  while (members.size() >= 3) {
    Comparison worst;
    std::size_t at = members.front();
    for (const std::size_t h : members) {
      const Comparison found = compareWithOthers(lines, members, h);
      if (found.severity() > worst.severity()) worst = found, at = h;
    }
    if (worst.severity() <= 1.0) break;
    faults[at] = {
        worst.skew() > worst.jump()
            ? formatted("trigger skew: the channels are shifted by %.2f samples relative to the other hits",
                        worst.shift)
            : formatted("gain jump: %.2f of the gain of the other hits", worst.gain),
        true};
    members.erase(std::find(members.begin(), members.end(), at));
  }
  return faults;
}

std::vector<HitFault> checkHits(const std::vector<Hit>& hits, const HitCheckOptions& options) {
  std::vector<HitFault> faults;
  std::vector<bool> usable;
  for (const Hit& hit : hits) {
    faults.push_back(hitFault(hit, options));
    usable.push_back(faults.back().text.empty());
  }
  const std::vector<HitFault> relative = faultsAmongHits(hits, usable);
  for (std::size_t h = 0; h < hits.size(); ++h) {
    if (usable[h]) faults[h] = relative[h];
  }
  return faults;
}

}  // namespace smartmill
