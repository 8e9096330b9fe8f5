#include "smartmill_daq/calibration/sensitivity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <ctime>

#include <boost/math/tools/minima.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill::daq {
namespace {

constexpr double PERIODS = 50.0;          // of a piece of an exciter's record
constexpr double FREQUENCY_RANGE = 0.02;  // [1] in which the exciter's frequency is searched
constexpr double MOST_DISTORTION = 0.1;   // [1] of the effective value
constexpr std::size_t LEAST_PIECES = 3;
constexpr std::size_t MASS_PIECES = 8;       // of each record at rest
constexpr double LEAST_LOAD = 5.0;           // [1] over the standard deviation of the difference
constexpr double CONTACT = 0.1;              // [1] of a hit's peak, above which both quantities are compared
constexpr double LEAST_PEAK = 0.2;           // [1] of the largest peak: weaker ones are no hits
constexpr double HIT_SPACING = 0.1;          // [s] at least between two hits
constexpr double MOST_DISPROPORTION = 0.05;  // [1] RMS of F - m a over that of F during contact

ReadingRatio ratioOf(const std::vector<double>& parts) {
  const auto count = static_cast<double>(parts.size());
  return {mean(parts), studentOverNormal(count - 1.0) * standardDeviation(parts) / std::sqrt(count),
          parts.size()};
}

void requireFinite(const std::vector<double>& samples) {
  const std::size_t at = firstNotFinite(samples);
  if (at < samples.size()) throw Error(formatted("sample %zu: not a finite number", at));
}

using Iterator = std::vector<double>::const_iterator;

/// Amplitude of a frequency in a piece without its mean, by a Hann window.
double amplitudeAt(Iterator begin, Iterator end, double rate, double frequency) {
  const auto count = static_cast<double>(end - begin);
  std::complex<double> sum = 0.0;
  double weights = 0.0, i = 0.0;
  for (Iterator at = begin; at != end; ++at, ++i) {
    const double weight = 1.0 - std::cos(units::TWO_PI * (i + 0.5) / count);
    sum += weight * *at * std::polar(1.0, -units::TWO_PI * frequency * i / rate);
    weights += weight;
  }
  return 2.0 * std::abs(sum) / weights;
}

/// The frequency of the largest amplitude: a Hann window has one maximum within two lines.
double frequencyOf(Iterator begin, Iterator end, double rate, double stated) {
  constexpr int BITS = 20;  // relative 1e-6
  const auto lost = [&](double frequency) { return -amplitudeAt(begin, end, rate, frequency); };
  const double reach = FREQUENCY_RANGE * stated;
  return boost::math::tools::brent_find_minima(lost, stated - reach, stated + reach, BITS).first;
}

std::vector<double> pieceMeans(const std::vector<double>& samples) {
  requireFinite(samples);
  const std::size_t length = samples.size() / MASS_PIECES;
  if (length < 2)
    throw Error(formatted("record of %zu samples: expected %zu or more", samples.size(), 2 * MASS_PIECES));
  std::vector<double> means;
  for (std::size_t k = 0; k < MASS_PIECES; ++k) {
    const auto from = samples.begin() + static_cast<std::ptrdiff_t>(k * length);
    means.push_back(mean({from, from + static_cast<std::ptrdiff_t>(length)}));
  }
  return means;
}

/// Samples of the force's peaks, at least HIT_SPACING apart.
std::vector<std::size_t> peaksOf(const std::vector<double>& force, double rate) {
  const double largest = *std::max_element(force.begin(), force.end());
  const auto spacing = static_cast<std::size_t>(HIT_SPACING * rate);
  std::vector<std::size_t> peaks;
  for (std::size_t i = 1; i + 1 < force.size(); ++i) {
    if (force[i] < LEAST_PEAK * largest || force[i] < force[i - 1] || force[i] < force[i + 1]) continue;
    if (!peaks.empty() && i - peaks.back() < spacing) {
      if (force[i] > force[peaks.back()]) peaks.back() = i;
    } else {
      peaks.push_back(i);
    }
  }
  return peaks;
}

}  // namespace

ReadingRatio ratioByExciter(const std::vector<double>& samples, double rate, double frequency, double rms) {
  requireFinite(samples);
  const auto length = static_cast<std::size_t>(std::ceil(PERIODS / frequency * rate));
  const std::size_t pieces = samples.size() / std::max<std::size_t>(1, length);
  if (pieces < LEAST_PIECES) {
    throw Error(formatted("record of %.2f s: expected %.2f s or more (%zu x %.0f periods of %.1f Hz)",
                          static_cast<double>(samples.size()) / rate,
                          static_cast<double>(LEAST_PIECES * length) / rate, LEAST_PIECES, PERIODS,
                          frequency));
  }
  std::vector<double> ratios;
  for (std::size_t k = 0; k < pieces; ++k) {
    const auto begin = samples.begin() + static_cast<std::ptrdiff_t>(k * length),
               end = begin + static_cast<std::ptrdiff_t>(length);
    std::vector<double> piece(begin, end);
    const double middle = mean(piece);
    for (double& sample : piece) sample -= middle;
    const double found = frequencyOf(piece.begin(), piece.end(), rate, frequency);
    const double effective = amplitudeAt(piece.begin(), piece.end(), rate, found) / std::sqrt(2.0);
    const double all = smartmill::rms(piece);
    const double distortion = std::sqrt(std::max(0.0, all * all - effective * effective)) / all;
    if (!(distortion < MOST_DISTORTION)) {
      throw Error(
          formatted("piece %zu: %.0f %% of the effective value is no sine of %.1f Hz +- %.0f %%, expected "
                    "less than %.0f %%",
                    k + 1, 100.0 * distortion, frequency, 100.0 * FREQUENCY_RANGE, 100.0 * MOST_DISTORTION));
    }
    ratios.push_back(effective / rms);
  }
  return ratioOf(ratios);
}

ReadingRatio ratioByMass(const std::vector<double>& without, const std::vector<double>& with, double force) {
  const std::vector<double> empty = pieceMeans(without), loaded = pieceMeans(with);
  const double count = static_cast<double>(MASS_PIECES);
  const double std_dev = std::hypot(standardDeviation(empty), standardDeviation(loaded)) / std::sqrt(count) *
                         studentOverNormal(2.0 * (count - 1.0));
  const double load = mean(loaded) - mean(empty);
  if (!(std::abs(load) > LEAST_LOAD * std_dev)) {
    throw Error(formatted("load of %.3g +- %.2g: expected more than %.0f standard deviations", load, std_dev,
                          LEAST_LOAD));
  }
  return {load / force, std_dev / std::abs(force), 2 * MASS_PIECES};
}

ReadingRatio ratioByHits(const std::vector<double>& force, const std::vector<double>& acceleration,
                         double rate, double mass) {
  requireFinite(force);
  requireFinite(acceleration);
  if (force.size() != acceleration.size())
    throw Error(formatted("%zu samples of force, %zu of acceleration: expected as many", force.size(),
                          acceleration.size()));
  std::vector<double> ratios;
  for (const std::size_t peak : force.empty() ? std::vector<std::size_t>() : peaksOf(force, rate)) {
    double fa = 0.0, aa = 0.0, ff = 0.0;
    const double least = CONTACT * force[peak];
    const auto add = [&](std::size_t i) {
      fa += force[i] * acceleration[i];
      aa += acceleration[i] * acceleration[i];
      ff += force[i] * force[i];
    };
    for (std::size_t i = peak; i < force.size() && force[i] > least; ++i) add(i);
    for (std::size_t i = peak; i-- > 0 && force[i] > least;) add(i);
    const double disproportion = std::sqrt(std::max(0.0, 1.0 - fa * fa / (aa * ff)));
    if (!(disproportion < MOST_DISPROPORTION)) {
      throw Error(
          formatted("hit at %.3f s: force and acceleration differ by %.0f %% from proportion, expected less "
                    "than %.0f %% (a rigid, freely hanging mass)",
                    static_cast<double>(peak) / rate, 100.0 * disproportion, 100.0 * MOST_DISPROPORTION));
    }
    ratios.push_back(fa / (aa * mass));
  }
  if (ratios.size() < LEAST_PIECES)
    throw Error(formatted("%zu hits: expected %zu or more", ratios.size(), LEAST_PIECES));
  return ratioOf(ratios);
}

NewSensitivity sensitivityOf(const Channel& channel, const ReadingRatio& ratio, double reference_std) {
  const double value = channel.sensitivity * ratio.value;
  return {value, std::abs(value) * std::hypot(ratio.std_dev / ratio.value, reference_std),
          channel.sensitivity, channel.unit, ratio.parts};
}

std::string sensitivityText(const std::string& channel, const NewSensitivity& sensitivity) {
  return formatted("%s: %.6g +- %.2g V/(%s), so far %.6g (%+.2f %%), from %zu parts of the record",
                   channel.c_str(), sensitivity.value, sensitivity.std_dev, sensitivity.unit.c_str(),
                   sensitivity.before, 100.0 * (sensitivity.value / sensitivity.before - 1.0),
                   sensitivity.parts);
}

std::string today() {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  ::localtime_r(&now, &local);
  std::array<char, 11> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%d", &local);
  return text.data();
}

}  // namespace smartmill::daq
