#include "smartmill_discrepancy/explain/places.h"

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

// A line of the residual as a hypothesis, its place where the residual has it.
void addLine(const std::vector<Hypothesis>& forms, const char* form, const Finding& f, double place,
             std::vector<Hypothesis>* lines) {
  const bool by_order = f.domain == "order";
  for (const Hypothesis& h : forms) {
    if (!isForm(h, form, f.channel)) continue;
    Hypothesis line = h;
    line.named(h.variant + formatted(by_order ? ", order %.4g" : ", %.4g Hz", place));
    const double size = std::max(f.amplitude, h.coordinates.back().step);
    if (by_order) {
      line.number("order", place).probe({0.0}, {{size}});
    } else {
      line.probe({place, 0.0}, {{place, size}});
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

// Whether a line can be told from a slow wander, which any sine of its own phase in each record follows, and
// from a tone that a state has on that channel: together they would give each record an amplitude of its own.
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

// ---- what is left of one channel of one test

struct Left {
  const TestData* test = nullptr;
  std::vector<double> values;  // over the noise, about their mean
  double mean = 0.0;
  double noise = 1.0;  // [unit of the channel]
};

std::map<std::string, std::vector<Left>> leftByChannel(const TwinRunner& runner,
                                                       const std::vector<double>& residual) {
  std::map<std::string, std::vector<Left>> channels;
  for (const Block& b : runner.blocks()) {
    if (b.slow || !b.judged) continue;
    const auto from = residual.begin() + static_cast<std::ptrdiff_t>(b.offset);
    Left left{&runner.data().tests[b.test], {from, from + static_cast<std::ptrdiff_t>(b.size)}, 0.0, b.noise};
    left.mean = mean(left.values);
    for (double& v : left.values) v -= left.mean;
    channels[b.channel].push_back(std::move(left));
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
Step stepInRecords(const std::vector<Left>& tests) {
  const double rate = tests.front().test->test.sample_rate;
  std::vector<double> product, squares;  // of the values and of the step's own, by its sample
  for (const Left& t : tests) {
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
Step stepBetweenTests(std::vector<Left> tests) {
  tests.erase(
      std::remove_if(tests.begin(), tests.end(), [](const Left& t) { return !t.test->test.start_time; }),
      tests.end());
  std::sort(tests.begin(), tests.end(),
            [](const Left& a, const Left& b) { return *a.test->test.start_time < *b.test->test.start_time; });
  double all = 0.0, sum = 0.0;
  for (const Left& t : tests) {
    all += static_cast<double>(t.values.size());
    sum += t.mean * static_cast<double>(t.values.size());
  }
  Step best;
  double before = 0.0, product = 0.0;
  for (std::size_t k = 0; k + 1 < tests.size(); ++k) {
    const Left& t = tests[k];
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

void addSteps(const std::vector<Hypothesis>& all, const std::string& channel, const std::vector<Left>& tests,
              std::vector<Hypothesis>* placed) {
  constexpr double LEAST_GAIN = 50.0;  // squares; below it the places that were looked at explain it
  for (const Hypothesis& h : all) {
    if (!isForm(h, "step", channel + ",")) continue;
    const bool record = h.variant == channel + ", record";
    const Step step = record ? stepInRecords(tests) : stepBetweenTests(tests);
    if (step.gain < LEAST_GAIN) continue;
    Hypothesis at = h;
    at.number("at_s", step.at).probe({0.0}, {{step.size * tests.front().noise}});
    placed->push_back(at.named(h.variant + formatted(", %.5g s", step.at)));
  }
}

// ---- bursts

struct Bursts {
  double period = 0.0, frequency = 0.0, amplitude = 0.0;  // [s], [Hz], over the noise
};

constexpr double BURST_DECAY = 2e-3;  // [s] with which they are looked for

// The band of a burst's width that holds most power beyond the median of all bands [Hz]; 0: none stands out.
double strongestBand(const std::vector<Left>& tests, double rate) {
  constexpr double WIDTH = 0.5 / BURST_DECAY, LEAST = 60.0;  // [Hz]
  constexpr double STANDS_OUT = 1.3;
  std::vector<double> power(static_cast<std::size_t>(0.5 * rate / WIDTH) + 1, 0.0);
  for (const Left& t : tests) {
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
  if (*best < STANDS_OUT * sorted[sorted.size() / 2]) return 0.0;
  // The centre of gravity of what stands out about it.
  double sum = 0.0, moment = 0.0;
  for (auto at = best == from ? best : best - 1; at != power.end() && at <= best + 1; ++at) {
    const double extra = std::max(*at - sorted[sorted.size() / 2], 0.0);
    sum += extra;
    moment += extra * (static_cast<double>(at - power.begin()) + 0.5);
  }
  return moment / sum * WIDTH;
}

// Power of a band about a frequency over time, behind a window of a burst's decay, about its mean.
std::vector<double> envelope(const std::vector<double>& values, double frequency, double rate) {
  const double keep = std::exp(-1.0 / (BURST_DECAY * rate));
  const std::complex<double> turn = std::polar(1.0, units::TWO_PI * frequency / rate);
  std::complex<double> inside;
  std::vector<double> power(values.size());
  for (std::size_t i = values.size(); i-- > 0;) {
    inside = keep * turn * inside + values[i];
    power[i] = std::norm(inside);
  }
  const double level = mean(power);
  for (double& p : power) p -= level;
  return power;
}

// Products of the envelopes with themselves so many samples later, over all tests.
std::vector<double> echoes(const std::vector<Left>& tests, double frequency, double rate) {
  constexpr double LEAST_COUNT = 3.0;  // of periods in a record
  std::vector<double> sum;
  for (const Left& t : tests) {
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

// The lag at which an echo stands highest, sharpened by those of its multiples [samples]; 0: none.
double periodOf(const std::vector<double>& echo, double rate) {
  constexpr double LEAST_ECHO = 0.15;  // of the envelope's own power
  const auto first = static_cast<std::size_t>(3.0 * BURST_DECAY * rate);
  if (echo.size() < 2 * first) return 0.0;
  const auto highestAbout = [&](double lag, double reach) {
    const auto from = static_cast<std::ptrdiff_t>(std::max(lag - reach, 1.0));
    const auto to =
        std::min(static_cast<std::ptrdiff_t>(lag + reach) + 1, static_cast<std::ptrdiff_t>(echo.size()) - 1);
    return from < to ? std::max_element(echo.begin() + from, echo.begin() + to) - echo.begin() : 0;
  };
  const auto top = std::max_element(echo.begin() + static_cast<std::ptrdiff_t>(first), echo.end());
  if (*top < LEAST_ECHO * echo.front()) return 0.0;
  // The first that is as high: later ones are its multiples.
  double lag = static_cast<double>(top - echo.begin());
  for (std::size_t k = first; k + 1 < echo.size(); ++k) {
    if (echo[k] < 0.8 * *top || echo[k] < echo[k - 1] || echo[k] < echo[k + 1]) continue;
    lag = static_cast<double>(k);
    break;
  }
  for (double count = 2.0; count * lag < static_cast<double>(echo.size()) - 2.0; ++count) {
    const auto at = highestAbout(count * lag, 2.0 + 0.5 * count);
    if (at > 0) lag = static_cast<double>(at) / count;
  }
  return lag;
}

// What comes with the spindle or its teeth is no beat of its own.
bool turnsWith(const std::vector<Left>& tests, double period) {
  constexpr double ALIKE = 0.02;
  return std::all_of(tests.begin(), tests.end(), [&](const Left& t) {
    const double turns = period * t.test->test.spindle_speed / units::TWO_PI;
    return t.test->test.kind == TestKind::tap ||
           (std::abs(turns - std::round(turns)) < ALIKE * turns ||
            std::abs(1.0 / turns - std::round(1.0 / turns)) < ALIKE / turns);
  });
}

std::optional<Bursts> burstsOf(std::vector<Left> tests) {
  const double rate = tests.front().test->test.sample_rate;
  tests.erase(std::remove_if(tests.begin(), tests.end(),
                             [&](const Left& t) { return t.test->test.sample_rate != rate; }),
              tests.end());
  Bursts found;
  found.frequency = strongestBand(tests, rate);
  if (found.frequency == 0.0) return {};
  found.period = periodOf(echoes(tests, found.frequency, rate), rate) / rate;
  if (found.period == 0.0 || turnsWith(tests, found.period)) return {};
  double squares = 0.0, count = 0.0;
  for (const Left& t : tests) {
    for (const double v : t.values) squares += v * v;
    count += static_cast<double>(t.values.size());
  }
  // A burst holds amplitude^2 decay / 4.
  const double extra = std::max(squares / count - 1.0, 1e-3);
  found.amplitude = std::sqrt(4.0 * extra * found.period / BURST_DECAY);
  return found;
}

void addBursts(const std::vector<Hypothesis>& all, const std::string& channel, const std::vector<Left>& tests,
               std::vector<Hypothesis>* placed) {
  for (const Hypothesis& h : all) {
    if (!isForm(h, "bursts", channel)) continue;
    const std::optional<Bursts> found = burstsOf(tests);
    if (!found) continue;
    Hypothesis at = h;
    const double period = std::log(found->period), frequency = std::log(found->frequency);
    for (const double decay : {0.25, 0.5, 1.0, 2.0, 4.0}) {
      const double d = std::log(decay * BURST_DECAY);
      at.probe({period, frequency, d, 0.0}, {{period, frequency, d, found->amplitude * tests.front().noise}});
    }
    placed->push_back(at.named(h.variant + formatted(", every %.4g s", found->period)));
  }
}

// ---- resonances

// A force channel of one test: what the model shows, and what is left, over the noise.
struct Shown {
  double rate = 0.0, noise = 1.0;
  std::vector<double> model, left;
};

std::map<std::string, std::map<std::size_t, Shown>> forcesShown(const TwinRunner& runner,
                                                                const std::vector<double>& residual) {
  std::map<std::string, std::map<std::size_t, Shown>> shown;
  for (const Block& b : runner.blocks()) {
    if (std::find(FORCES.begin(), FORCES.end(), b.channel) == FORCES.end() || b.slow || !b.judged) continue;
    Shown& s = shown[b.channel][b.test];
    s.rate = runner.data().tests[b.test].test.sample_rate;
    s.noise = b.noise;
    for (std::size_t i = b.offset; i < b.offset + b.size; ++i) {
      s.model.push_back(runner.measured()[i] - residual[i]);
      s.left.push_back(residual[i]);
    }
  }
  return shown;
}

struct Place {
  double frequency = 0.0, gain = 0.0, squares = 0.0;  // [Hz], of the path, that it takes from what is left
};

constexpr double MODE_DAMPING = 0.04;  // with which modes are looked for

// What a mode of one share of the path takes.
Place resonanceAt(double frequency, const std::map<std::size_t, Shown>& to,
                  const std::map<std::size_t, Shown>& from, bool itself) {
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
      const double x = source.model[i], column = scale * (mode.step(x) - (itself ? x : 0.0));
      product += column * target->second.left[i];
      squares += column * column;
    }
  }
  return {frequency, product / squares, product * product / squares};
}

/// Of the frequencies that records of a rate hold, the one at which a resonance takes most.
Place bestResonance(const TwinRunner& runner, double rate, const std::map<std::size_t, Shown>& to,
                    const std::map<std::size_t, Shown>& from, bool itself) {
  constexpr double RATIO = 1.05, LOWEST = 60.0, HIGHEST = 0.42;
  std::vector<double> frequencies;
  for (double f = LOWEST; f < HIGHEST * rate; f *= RATIO) frequencies.push_back(f);
  std::vector<Place> places(frequencies.size());
  runParallel(frequencies.size(), runner.threads(),
              [&](std::size_t k) { places[k] = resonanceAt(frequencies[k], to, from, itself); });
  return *std::max_element(places.begin(), places.end(),
                           [](const Place& a, const Place& b) { return a.squares < b.squares; });
}

void addResonances(const std::vector<Hypothesis>& all, const TwinRunner& runner,
                   const std::vector<double>& residual, std::vector<Hypothesis>* placed) {
  constexpr double LEAST = 100.0;
  const auto shown = forcesShown(runner, residual);
  double rate = 0.0;
  for (const TestData& t : runner.data().tests) rate = std::max(rate, t.test.sample_rate);
  for (const auto& [to, left] : shown) {
    for (const auto& [from, source] : shown) {
      const std::string variant = to + " from " + from;
      for (const Hypothesis& h : all) {
        if (!isForm(h, "resonance", variant)) continue;
        const Place best = bestResonance(runner, rate, left, source, to == from);
        if (best.squares < LEAST) continue;
        Hypothesis at = h;
        const double f = std::log(best.frequency), d = std::log(MODE_DAMPING);
        at.probe({f, d, 0.0}, {{f, d, std::clamp(best.gain, -1.0, 1.0)}});
        placed->push_back(at.named(variant + formatted(", %.4g Hz", best.frequency)));
      }
    }
  }
}

}  // namespace

std::vector<Hypothesis> placedForms(const TwinRunner& runner, const std::vector<Hypothesis>& all,
                                    const Fit& now, const std::vector<Finding>& unexplained) {
  constexpr std::size_t MOST_LINES = 12;
  std::vector<Hypothesis> placed;
  for (const Finding& f : unexplained) {
    if (placed.size() >= MOST_LINES) break;
    if (f.domain == "frequency" && isTone(runner.data(), now.state, f))
      addLine(all, "tone", f, f.location.at("frequency_hz"), &placed);
    if (f.domain == "order") addLine(all, "order", f, f.location.at("order"), &placed);
  }
  for (const auto& [channel, tests] : leftByChannel(runner, now.residual)) {
    addSteps(all, channel, tests, &placed);
    addBursts(all, channel, tests, &placed);
  }
  addResonances(all, runner, now.residual, &placed);
  return placed;
}

}  // namespace smartmill::discrepancy
