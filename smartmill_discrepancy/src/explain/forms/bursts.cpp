#include <algorithm>
#include <cmath>
#include <complex>
#include <optional>

#include "explain/forms/form_family.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

struct BurstOptions {
  double decay = 2e-3;            ///< [s] assumed for detection; the fit starts from several
  double lowest = LOWEST_MODE;    ///< [Hz] of a band
  double prominence = 1.3;        ///< [1] power of a band over the median of all
  double min_count = 3.0;         ///< periods in a record: fewer do not distinguish a period
  double min_period = 3.0;        ///< [1] of the decay: shorter periods overlap
  double min_correlation = 0.15;  ///< [1] of the envelope with itself at the period
  double similar_peak = 0.8;  ///< [1] of the highest correlation: the first such peak is the period itself
  double synchronous = 0.02;  ///< [1] of a revolution: such a period is an order of the spindle
  /// [1] of the assumed decay: those from which a fit starts
  std::vector<double> start_decays{0.25, 0.5, 1.0, 2.0, 4.0};
};

struct BurstTrain {
  double period = 0.0, frequency = 0.0, amplitude = 0.0;  // [s], [Hz], over the noise
};

// Centre frequency [Hz] of the band with the largest power over the median of all bands; 0: no prominent
// band.
double strongestBand(const std::vector<ChannelResidual>& tests, double rate, const BurstOptions& options) {
  const double width = 0.5 / options.decay;  // [Hz]
  std::vector<double> power(static_cast<std::size_t>(0.5 * rate / width) + 1, 0.0);
  for (const ChannelResidual& t : tests) {
    const auto spectrum = fourier(t.values);
    const std::vector<double> frequency = fourierFrequencies(t.values.size(), rate);
    for (std::size_t k = 0; k < spectrum.size(); ++k)
      power[static_cast<std::size_t>(frequency[k] / width)] += std::norm(spectrum[k]);
  }
  power.pop_back();
  if (power.size() < 4) return 0.0;
  std::vector<double> sorted = power;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2),
                   sorted.end());
  const auto from = power.begin() + static_cast<std::ptrdiff_t>(options.lowest / width);
  const auto best = std::max_element(from, power.end());
  if (*best < options.prominence * sorted[sorted.size() / 2]) return 0.0;
  // Centre of gravity of the excess power.
  double sum = 0.0, moment = 0.0;
  for (auto at = best == from ? best : best - 1; at != power.end() && at <= best + 1; ++at) {
    const double extra = std::max(*at - sorted[sorted.size() / 2], 0.0);
    sum += extra;
    moment += extra * (static_cast<double>(at - power.begin()) + 0.5);
  }
  return moment / sum * width;
}

// Mean-free power of a band over time, with a window of one burst decay.
std::vector<double> envelope(const std::vector<double>& values, double frequency, double rate,
                             double burst_decay) {
  const double decay = std::exp(-1.0 / (burst_decay * rate));
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
std::vector<double> autocorrelation(const std::vector<ChannelResidual>& tests, double frequency, double rate,
                                    const BurstOptions& options) {
  std::vector<double> sum;
  for (const ChannelResidual& t : tests) {
    std::vector<double> power = envelope(t.values, frequency, rate, options.decay);
    const std::size_t n = power.size();
    power.resize(2 * n, 0.0);
    auto spectrum = fourier(power);
    for (std::complex<double>& x : spectrum) x = std::norm(x);
    const std::vector<double> product = inverseFourier(spectrum, 2 * n);
    const auto longest = static_cast<std::size_t>(static_cast<double>(n) / options.min_count);
    if (sum.size() < longest) sum.resize(longest, 0.0);
    for (std::size_t k = 0; k < longest; ++k)
      sum[k] += product[k] * static_cast<double>(n) / static_cast<double>(n - k);
  }
  return sum;
}

// Lag of the highest correlation, refined by its multiples [samples]; 0: none.
double periodOf(const std::vector<double>& correlation, double rate, const BurstOptions& options) {
  const auto first = static_cast<std::size_t>(options.min_period * options.decay * rate);
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
  if (*top < options.min_correlation * correlation.front()) return 0.0;
  // The first peak of similar height: later ones are its multiples.
  double lag = static_cast<double>(top - correlation.begin());
  for (std::size_t k = first; k + 1 < correlation.size(); ++k) {
    if (correlation[k] < options.similar_peak * *top || correlation[k] < correlation[k - 1] ||
        correlation[k] < correlation[k + 1])
      continue;
    lag = static_cast<double>(k);
    break;
  }
  // A peak at a whole lag is within half a sample; multiples that disagree by more are other peaks.
  const double peak = lag;
  for (double count = 2.0; count * lag < static_cast<double>(correlation.size()) - 2.0; ++count) {
    const double refined = static_cast<double>(highestAbout(count * lag, 2.0 + 0.5 * count)) / count;
    if (std::abs(refined - peak) > 1.0) break;
    lag = refined;
  }
  return lag;
}

// Whether a period is a multiple or fraction of the spindle's.
bool isSpindleSynchronous(const std::vector<ChannelResidual>& tests, double period, double alike) {
  return std::all_of(tests.begin(), tests.end(), [&](const ChannelResidual& t) {
    const double revolutions = period * t.test->test.spindle_speed / units::TWO_PI;
    return t.test->test.kind == TestKind::tap ||
           (std::abs(revolutions - std::round(revolutions)) < alike * revolutions ||
            std::abs(1.0 / revolutions - std::round(1.0 / revolutions)) < alike / revolutions);
  });
}

std::optional<BurstTrain> findBursts(std::vector<ChannelResidual> tests, const BurstOptions& options) {
  const double rate = tests.front().test->test.sample_rate;
  tests.erase(std::remove_if(tests.begin(), tests.end(),
                             [&](const ChannelResidual& t) { return t.test->test.sample_rate != rate; }),
              tests.end());
  BurstTrain found;
  found.frequency = strongestBand(tests, rate, options);
  if (found.frequency == 0.0) return {};
  found.period = periodOf(autocorrelation(tests, found.frequency, rate, options), rate, options) / rate;
  if (found.period == 0.0 || isSpindleSynchronous(tests, found.period, options.synchronous)) return {};
  double squares = 0.0, count = 0.0;
  for (const ChannelResidual& t : tests) {
    for (const double v : t.values) squares += v * v;
    count += static_cast<double>(t.values.size());
  }
  constexpr double MIN_EXTRA = 1e-3;  // for a positive amplitude
  // The energy of a burst is amplitude^2 decay / 4.
  const double extra = std::max(squares / count - 1.0, MIN_EXTRA);
  found.amplitude = std::sqrt(4.0 * extra * found.period / options.decay);
  return found;
}

/// Bursts at the period of the envelope in the strongest band of each channel.
class Bursts : public FormFamily {
 public:
  void locate(const FormContext& context, std::vector<Hypothesis>* located) const override {
    for (const auto& [channel, tests] : context.channels) {
      for (const Hypothesis& h : context.forms) {
        if (!isForm(h, "bursts", channel)) continue;
        const std::optional<BurstTrain> found = findBursts(tests, options_);
        if (!found) continue;
        Hypothesis at = h;
        const double period = std::log(found->period), frequency = std::log(found->frequency);
        for (const double decay : options_.start_decays) {
          const double d = std::log(decay * options_.decay);
          at.probe({period, frequency, d, 0.0},
                   {{period, frequency, d, found->amplitude * tests.front().noise}});
        }
        located->push_back(at.named(h.variant + formatted(", every %.4g s", found->period)));
      }
    }
  }

 private:
  BurstOptions options_;
};

}  // namespace

std::unique_ptr<FormFamily> makeBursts() {
  return std::make_unique<Bursts>();
}

}  // namespace smartmill::discrepancy
