#include "smartmill_discrepancy/explain/residual_localisation.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <map>
#include <optional>
#include <string>

#include "smartmill_core/formatted.h"
#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

bool isForm(const Hypothesis& h, const char* form, const std::string& variant) {
  return h.effect == std::string(EMPIRICAL) + ":" + form && h.variant.rfind(variant, 0) == 0;
}

// ---- lines

// A line of the residual as a hypothesis at its order or frequency.
void addLine(const std::vector<Hypothesis>& forms, const char* form, const Finding& f, double location,
             std::vector<Hypothesis>* lines) {
  const bool by_order = f.domain == "order";
  for (const Hypothesis& h : forms) {
    if (!isForm(h, form, f.channel)) continue;
    Hypothesis line = h;
    line.named(h.variant + formatted(by_order ? ", order %.4g" : ", %.4g Hz", location));
    const double size = std::max(f.amplitude, h.coordinates.back().step);
    if (by_order) {
      line.number("order", location).probe({0.0}, {{size}});
    } else {
      line.probe({location, 0.0}, {{location, size}});
    }
    lines->push_back(std::move(line));
  }
}

double longestRecord(const Dataset& data) {
  double longest = 0.0;
  for (const TestData& t : data.tests) {
    if (t.record.size() > 1) longest = std::max(longest, t.record.time.back() - t.record.time.front());
  }
  return longest;
}

// Whether a line differs from a slow drift, which a sine with free phases in each record can follow, and from
// an existing tone of the channel, with which it would form individual amplitudes.
bool isTone(const Dataset& data, const FitState& state, const Finding& f) {
  constexpr double LEAST_CYCLES = 4.0, RESOLVED = 2.0;
  const double frequency = f.location.at("frequency_hz"), longest = longestRecord(data);
  return frequency * longest > LEAST_CYCLES &&
         std::none_of(state.members.begin(), state.members.end(), [&](const Member& m) {
           const EffectEntry e = m.hypothesis->entry(m.values);
           return e.name == std::string(EMPIRICAL) + ":tone" && e.words.at("channel") == f.channel &&
                  std::abs(e.numbers.at("frequency_hz") - frequency) * longest < RESOLVED;
         });
}

// ---- residual of one channel of one test

struct ChannelResidual {
  const TestData* test = nullptr;
  std::vector<double> values;  // over the noise, about their mean
  double mean = 0.0;
  double noise = 1.0;  // [unit of the channel]
};

std::map<std::string, std::vector<ChannelResidual>> residualByChannel(const TwinRunner& runner,
                                                                      const std::vector<double>& residual) {
  std::map<std::string, std::vector<ChannelResidual>> channels;
  for (const ChannelSpan& b : runner.spans()) {
    if (b.slow || !b.in_gap) continue;
    const auto from = residual.begin() + static_cast<std::ptrdiff_t>(b.offset);
    ChannelResidual channel{
        &runner.data().tests[b.test], {from, from + static_cast<std::ptrdiff_t>(b.size)}, 0.0, b.noise};
    channel.mean = mean(channel.values);
    for (double& v : channel.values) v -= channel.mean;
    channels[b.channel].push_back(std::move(channel));
  }
  return channels;
}

// ---- steps

struct Step {
  double at = 0.0;    // [s]
  double size = 0.0;  // over the noise
  double gain = 0.0;  // squares
};

// One step at the same time of every record.
Step stepInRecords(const std::vector<ChannelResidual>& tests) {
  const double rate = tests.front().test->test.sample_rate;
  std::vector<double> product, squares;  // with the step, and of the step itself, by its sample
  for (const ChannelResidual& t : tests) {
    if (t.test->test.sample_rate != rate) continue;
    const std::size_t n = t.values.size();
    if (product.size() < n) product.resize(n, 0.0), squares.resize(n, 0.0);
    double after = 0.0;
    for (std::size_t i = n - 1; i > 0; --i) {
      after += t.values[i];
      const double share = static_cast<double>(n - i) / static_cast<double>(n);
      product[i] += after;
      squares[i] += static_cast<double>(i) * share;
    }
  }
  Step best;
  for (std::size_t i = 1; i < product.size(); ++i) {
    const double gain = product[i] * product[i] / squares[i];
    if (gain > best.gain) best = {(static_cast<double>(i) - 0.5) / rate, product[i] / squares[i], gain};
  }
  return best;
}

// One step between two tests.
Step stepBetweenTests(std::vector<ChannelResidual> tests) {
  tests.erase(std::remove_if(tests.begin(), tests.end(),
                             [](const ChannelResidual& t) { return !t.test->test.start_time; }),
              tests.end());
  std::sort(tests.begin(), tests.end(), [](const ChannelResidual& a, const ChannelResidual& b) {
    return *a.test->test.start_time < *b.test->test.start_time;
  });
  double all = 0.0, sum = 0.0;
  for (const ChannelResidual& t : tests) {
    all += static_cast<double>(t.values.size());
    sum += t.mean * static_cast<double>(t.values.size());
  }
  Step best;
  double before = 0.0, product = 0.0;
  for (std::size_t k = 0; k + 1 < tests.size(); ++k) {
    const ChannelResidual& t = tests[k];
    const auto n = static_cast<double>(t.values.size());
    before += n;
    product -= n * (t.mean - sum / all);
    const double squares = before * (all - before) / all, gain = product * product / squares;
    if (gain <= best.gain) continue;
    const double end = *t.test->test.start_time + n / t.test->test.sample_rate;
    best = {0.5 * (end + *tests[k + 1].test->test.start_time), product / squares, gain};
  }
  return best;
}

void addSteps(const std::vector<Hypothesis>& all, const std::string& channel,
              const std::vector<ChannelResidual>& tests, std::vector<Hypothesis>* localised) {
  constexpr double LEAST_GAIN = 50.0;  // squares: chance maximum over all positions
  for (const Hypothesis& h : all) {
    if (!isForm(h, "step", channel + ",")) continue;
    const bool record = h.variant == channel + ", record";
    const Step step = record ? stepInRecords(tests) : stepBetweenTests(tests);
    if (step.gain < LEAST_GAIN) continue;
    Hypothesis at = h;
    at.number("at_s", step.at).probe({0.0}, {{step.size * tests.front().noise}});
    localised->push_back(at.named(h.variant + formatted(", %.5g s", step.at)));
  }
}

// ---- bursts

struct BurstTrain {
  double period = 0.0, frequency = 0.0, amplitude = 0.0;  // [s], [Hz], over the noise
};

constexpr double BURST_DECAY = 2e-3;  // [s] assumed for detection

// Centre frequency [Hz] of the band with the largest power over the median of all bands; 0: no prominent
// band.
double strongestBand(const std::vector<ChannelResidual>& tests, double rate) {
  constexpr double WIDTH = 0.5 / BURST_DECAY, LEAST = 60.0;  // [Hz]
  constexpr double PROMINENCE = 1.3;
  std::vector<double> power(static_cast<std::size_t>(0.5 * rate / WIDTH) + 1, 0.0);
  for (const ChannelResidual& t : tests) {
    const auto spectrum = fourier(t.values);
    const std::vector<double> frequency = fourierFrequencies(t.values.size(), rate);
    for (std::size_t k = 0; k < spectrum.size(); ++k)
      power[static_cast<std::size_t>(frequency[k] / WIDTH)] += std::norm(spectrum[k]);
  }
  power.pop_back();
  if (power.size() < 4) return 0.0;
  std::vector<double> sorted = power;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2),
                   sorted.end());
  const auto from = power.begin() + static_cast<std::ptrdiff_t>(LEAST / WIDTH);
  const auto best = std::max_element(from, power.end());
  if (*best < PROMINENCE * sorted[sorted.size() / 2]) return 0.0;
  // Centre of gravity of the excess power.
  double sum = 0.0, moment = 0.0;
  for (auto at = best == from ? best : best - 1; at != power.end() && at <= best + 1; ++at) {
    const double extra = std::max(*at - sorted[sorted.size() / 2], 0.0);
    sum += extra;
    moment += extra * (static_cast<double>(at - power.begin()) + 0.5);
  }
  return moment / sum * WIDTH;
}

// Mean-free power of a band over time, with a window of one burst decay.
std::vector<double> envelope(const std::vector<double>& values, double frequency, double rate) {
  const double decay = std::exp(-1.0 / (BURST_DECAY * rate));
  const std::complex<double> rotation = std::polar(1.0, units::TWO_PI * frequency / rate);
  std::complex<double> filtered;
  std::vector<double> power(values.size());
  for (std::size_t i = values.size(); i-- > 0;) {
    filtered = decay * rotation * filtered + values[i];
    power[i] = std::norm(filtered);
  }
  const double level = mean(power);
  for (double& p : power) p -= level;
  return power;
}

// Autocorrelation of the envelopes by lag in samples, over all tests.
std::vector<double> autocorrelation(const std::vector<ChannelResidual>& tests, double frequency,
                                    double rate) {
  constexpr double LEAST_COUNT = 3.0;  // periods in a record
  std::vector<double> sum;
  for (const ChannelResidual& t : tests) {
    std::vector<double> power = envelope(t.values, frequency, rate);
    const std::size_t n = power.size();
    power.resize(2 * n, 0.0);
    auto spectrum = fourier(power);
    for (std::complex<double>& x : spectrum) x = std::norm(x);
    const std::vector<double> product = inverseFourier(spectrum, 2 * n);
    const auto longest = static_cast<std::size_t>(static_cast<double>(n) / LEAST_COUNT);
    if (sum.size() < longest) sum.resize(longest, 0.0);
    for (std::size_t k = 0; k < longest; ++k)
      sum[k] += product[k] * static_cast<double>(n) / static_cast<double>(n - k);
  }
  return sum;
}

// Lag of the highest correlation, refined by its multiples [samples]; 0: none.
double periodOf(const std::vector<double>& correlation, double rate) {
  constexpr double MIN_CORRELATION = 0.15;  // of the correlation at lag 0
  const auto first = static_cast<std::size_t>(3.0 * BURST_DECAY * rate);
  if (correlation.size() < 2 * first) return 0.0;
  const auto highestAbout = [&](double lag, double reach) {
    const auto from = static_cast<std::ptrdiff_t>(std::max(lag - reach, 1.0));
    const auto to = std::min(static_cast<std::ptrdiff_t>(lag + reach) + 1,
                             static_cast<std::ptrdiff_t>(correlation.size()) - 1);
    return from < to
               ? std::max_element(correlation.begin() + from, correlation.begin() + to) - correlation.begin()
               : 0;
  };
  const auto top =
      std::max_element(correlation.begin() + static_cast<std::ptrdiff_t>(first), correlation.end());
  if (*top < MIN_CORRELATION * correlation.front()) return 0.0;
  // The first peak of similar height: later ones are its multiples.
  double lag = static_cast<double>(top - correlation.begin());
  for (std::size_t k = first; k + 1 < correlation.size(); ++k) {
    if (correlation[k] < 0.8 * *top || correlation[k] < correlation[k - 1] ||
        correlation[k] < correlation[k + 1])
      continue;
    lag = static_cast<double>(k);
    break;
  }
  for (double count = 2.0; count * lag < static_cast<double>(correlation.size()) - 2.0; ++count) {
    const auto at = highestAbout(count * lag, 2.0 + 0.5 * count);
    if (at > 0) lag = static_cast<double>(at) / count;
  }
  return lag;
}

// Whether a period is a multiple or fraction of the spindle's.
bool isSpindleSynchronous(const std::vector<ChannelResidual>& tests, double period) {
  constexpr double ALIKE = 0.02;
  return std::all_of(tests.begin(), tests.end(), [&](const ChannelResidual& t) {
    const double revolutions = period * t.test->test.spindle_speed / units::TWO_PI;
    return t.test->test.kind == TestKind::tap ||
           (std::abs(revolutions - std::round(revolutions)) < ALIKE * revolutions ||
            std::abs(1.0 / revolutions - std::round(1.0 / revolutions)) < ALIKE / revolutions);
  });
}

std::optional<BurstTrain> findBursts(std::vector<ChannelResidual> tests) {
  const double rate = tests.front().test->test.sample_rate;
  tests.erase(std::remove_if(tests.begin(), tests.end(),
                             [&](const ChannelResidual& t) { return t.test->test.sample_rate != rate; }),
              tests.end());
  BurstTrain found;
  found.frequency = strongestBand(tests, rate);
  if (found.frequency == 0.0) return {};
  found.period = periodOf(autocorrelation(tests, found.frequency, rate), rate) / rate;
  if (found.period == 0.0 || isSpindleSynchronous(tests, found.period)) return {};
  double squares = 0.0, count = 0.0;
  for (const ChannelResidual& t : tests) {
    for (const double v : t.values) squares += v * v;
    count += static_cast<double>(t.values.size());
  }
  // The energy of a burst is amplitude^2 decay / 4.
  const double extra = std::max(squares / count - 1.0, 1e-3);
  found.amplitude = std::sqrt(4.0 * extra * found.period / BURST_DECAY);
  return found;
}

void addBursts(const std::vector<Hypothesis>& all, const std::string& channel,
               const std::vector<ChannelResidual>& tests, std::vector<Hypothesis>* localised) {
  for (const Hypothesis& h : all) {
    if (!isForm(h, "bursts", channel)) continue;
    const std::optional<BurstTrain> found = findBursts(tests);
    if (!found) continue;
    Hypothesis at = h;
    const double period = std::log(found->period), frequency = std::log(found->frequency);
    for (const double decay : {0.25, 0.5, 1.0, 2.0, 4.0}) {
      const double d = std::log(decay * BURST_DECAY);
      at.probe({period, frequency, d, 0.0}, {{period, frequency, d, found->amplitude * tests.front().noise}});
    }
    localised->push_back(at.named(h.variant + formatted(", every %.4g s", found->period)));
  }
}

// ---- resonances

// Model and residual of a force channel of one test, over the noise.
struct ForceResidual {
  double rate = 0.0, noise = 1.0;
  std::vector<double> model, residual;
};

std::map<std::string, std::map<std::size_t, ForceResidual>> forceResiduals(
    const TwinRunner& runner, const std::vector<double>& residual) {
  std::map<std::string, std::map<std::size_t, ForceResidual>> forces;
  for (const ChannelSpan& b : runner.spans()) {
    if (std::find(FORCES.begin(), FORCES.end(), b.channel) == FORCES.end() || b.slow || !b.in_gap) continue;
    ForceResidual& s = forces[b.channel][b.test];
    s.rate = runner.data().tests[b.test].test.sample_rate;
    s.noise = b.noise;
    for (std::size_t i = b.offset; i < b.offset + b.size; ++i) {
      s.model.push_back(runner.measured()[i] - residual[i]);
      s.residual.push_back(residual[i]);
    }
  }
  return forces;
}

struct Resonance {
  double frequency = 0.0, gain = 0.0,
         squares = 0.0;  // [Hz], of the path, reduction of the residual's squares
};

constexpr double MODE_DAMPING = 0.04;  // assumed for detection

// Reduction by one mode between two channels.
Resonance resonanceAt(double frequency, const std::map<std::size_t, ForceResidual>& to,
                      const std::map<std::size_t, ForceResidual>& from, bool same_channel) {
  ModalModel path;
  path.modes.resize(1);
  path.modes.front().frequency = frequency;
  path.modes.front().damping_ratio = MODE_DAMPING;
  path.modes.front().gain = 1.0;
  double product = 0.0, squares = 1e-300;
  for (const auto& [test, source] : from) {
    const auto target = to.find(test);
    if (target == to.end() || frequency > 0.45 * source.rate) continue;
    ModalFilter mode(path, source.rate, Hold::first_order);
    const double scale = source.noise / target->second.noise;
    for (std::size_t i = 0; i < source.model.size(); ++i) {
      const double x = source.model[i], column = scale * (mode.step(x) - (same_channel ? x : 0.0));
      product += column * target->second.residual[i];
      squares += column * column;
    }
  }
  return {frequency, product / squares, product * product / squares};
}

/// Best resonance among the frequencies that a sample rate resolves.
Resonance bestResonance(const TwinRunner& runner, double rate, const std::map<std::size_t, ForceResidual>& to,
                        const std::map<std::size_t, ForceResidual>& from, bool same_channel) {
  constexpr double RATIO = 1.05, LOWEST = 60.0, HIGHEST = 0.42;
  std::vector<double> frequencies;
  for (double f = LOWEST; f < HIGHEST * rate; f *= RATIO) frequencies.push_back(f);
  std::vector<Resonance> candidates(frequencies.size());
  runParallel(frequencies.size(), runner.threads(),
              [&](std::size_t k) { candidates[k] = resonanceAt(frequencies[k], to, from, same_channel); });
  return *std::max_element(candidates.begin(), candidates.end(),
                           [](const Resonance& a, const Resonance& b) { return a.squares < b.squares; });
}

void addResonances(const std::vector<Hypothesis>& all, const TwinRunner& runner,
                   const std::vector<double>& residual, std::vector<Hypothesis>* localised) {
  constexpr double LEAST = 100.0;
  const auto forces = forceResiduals(runner, residual);
  double rate = 0.0;
  for (const TestData& t : runner.data().tests) rate = std::max(rate, t.test.sample_rate);
  for (const auto& [to, target] : forces) {
    for (const auto& [from, source] : forces) {
      const std::string variant = to + " from " + from;
      for (const Hypothesis& h : all) {
        if (!isForm(h, "resonance", variant)) continue;
        const Resonance best = bestResonance(runner, rate, target, source, to == from);
        if (best.squares < LEAST) continue;
        Hypothesis at = h;
        const double f = std::log(best.frequency), d = std::log(MODE_DAMPING);
        at.probe({f, d, 0.0}, {{f, d, std::clamp(best.gain, -1.0, 1.0)}});
        localised->push_back(at.named(variant + formatted(", %.4g Hz", best.frequency)));
      }
    }
  }
}

}  // namespace

std::vector<Hypothesis> localisedForms(const TwinRunner& runner, const std::vector<Hypothesis>& all,
                                       const FitResult& now, const std::vector<Finding>& unexplained) {
  constexpr std::size_t MOST_LINES = 12;
  std::vector<Hypothesis> localised;
  for (const Finding& f : unexplained) {
    if (localised.size() >= MOST_LINES) break;
    if (f.domain == "frequency" && isTone(runner.data(), now.state, f))
      addLine(all, "tone", f, f.location.at("frequency_hz"), &localised);
    if (f.domain == "order") addLine(all, "order", f, f.location.at("order"), &localised);
  }
  for (const auto& [channel, tests] : residualByChannel(runner, now.residual)) {
    addSteps(all, channel, tests, &localised);
    addBursts(all, channel, tests, &localised);
  }
  addResonances(all, runner, now.residual, &localised);
  return localised;
}

}  // namespace smartmill::discrepancy
