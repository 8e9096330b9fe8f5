#include "smartmill_core/signal/stream_shift.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>

#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/statistics.h"

namespace smartmill {
namespace {

using Values = std::vector<double>;

const double ROUNDING = std::sqrt(1.0 / 12.0);  // standard deviation of a uniform distribution of width 1

// Sums over the overlap of a late signal and the early one before it by each shift, from -last to last
// samples.
struct Sums {
  Values product, late, early;  // sum l e, sum l2, sum e2

  explicit Sums(std::size_t last) : product(2 * last + 1), late(product), early(product) {}

  void add(const Sums& other) {
    for (std::size_t k = 0; k < product.size(); ++k) {
      product[k] += other.product[k];
      late[k] += other.late[k];
      early[k] += other.early[k];
    }
  }
  // [1] of the squares of the late signal, by one factor on the early one
  double explained(std::size_t k) const {
    const double squares = late[k] * early[k];
    return squares > 0.0 ? product[k] * product[k] / squares : 0.0;
  }
  std::size_t best() const {
    std::size_t best = 0;
    for (std::size_t k = 1; k < product.size(); ++k) best = explained(k) > explained(best) ? k : best;
    return best;
  }
};

Values cumulativeSquares(const Values& values) {
  Values sums(1, 0.0);
  for (const double v : values) sums.push_back(sums.back() + v * v);
  return sums;
}

// Correlation by the transform of the padded signals.
Sums sumsOf(const SignalPair& pair, std::size_t last) {
  const std::size_t n = pair.late.size(), padded = n + last + 1;
  Values l = pair.late, e = pair.early;
  l.resize(padded);
  e.resize(padded);
  std::vector<std::complex<double>> spectrum = fourier(l);
  const std::vector<std::complex<double>> other = fourier(e);
  for (std::size_t k = 0; k < spectrum.size(); ++k) spectrum[k] *= std::conj(other[k]);
  const Values correlation = inverseFourier(spectrum, padded);
  const Values late = cumulativeSquares(pair.late), early = cumulativeSquares(pair.early);
  Sums sums(last);
  for (std::size_t k = 0; k < sums.product.size(); ++k) {
    const auto shift = static_cast<std::int64_t>(k) - static_cast<std::int64_t>(last);
    const std::size_t size = static_cast<std::size_t>(std::abs(shift));
    if (size >= n) continue;
    const bool later = shift >= 0;
    sums.product[k] = correlation[later ? size : padded - size];
    sums.late[k] = later ? late[n] - late[size] : late[n - size];
    sums.early[k] = later ? early[n - size] : early[n] - early[size];
  }
  return sums;
}

// Whether another shift, outside the peak about the best one, explains nearly as much.
bool isAmbiguous(const Sums& sums, std::size_t best, const StreamShiftOptions& options) {
  const double most = sums.explained(best);
  std::size_t from = best, to = best;
  while (from > 0 && sums.explained(from) > options.lobe * most) --from;
  while (to + 1 < sums.product.size() && sums.explained(to) > options.lobe * most) ++to;
  for (std::size_t k = 0; k < sums.product.size(); ++k) {
    if ((k < from || k > to) && sums.explained(k) > options.max_other * most) return true;
  }
  return false;
}

// Parabola through the explained shares at half the width of the peak to either side.
struct Top {
  double at = 0.0;         // [samples]
  double curvature = 0.0;  // [1/samples2] of the share, relative to its largest value
};

Top topOf(const Sums& sums, std::size_t best) {
  std::size_t reach = 1;
  const double most = sums.explained(best);
  while (best > reach && best + reach + 1 < sums.product.size() &&
         std::min(sums.explained(best - reach), sums.explained(best + reach)) > 0.9 * most)
    ++reach;
  const double before = sums.explained(best - reach), after = sums.explained(best + reach);
  const double bend = 2.0 * most - before - after, width = static_cast<double>(reach);
  if (!(bend > 0.0)) return {static_cast<double>(best), 0.0};
  return {static_cast<double>(best) + 0.5 * width * (after - before) / bend,
          bend / (2.0 * most * width * width)};
}

bool isAtAnEnd(const Sums& sums, std::size_t at) {
  return at == 0 || at + 1 == sums.product.size();
}

// [samples] Scatter of the shifts of the single records about the common one, each by its share of the
// squares.
double scatterOf(const std::vector<Sums>& records, double top, const StreamShiftOptions& options) {
  double weights = 0.0, squares = 0.0, count = 0.0;
  for (const Sums& sums : records) {
    const std::size_t own = sums.best();
    if (sums.explained(own) < options.min_explained || isAtAnEnd(sums, own)) continue;
    weights += sums.early[own];
    squares += sums.early[own] * std::pow(topOf(sums, own).at - top, 2);
    count += 1.0;
  }
  return count > 1.0 ? std::sqrt(squares / weights / (count - 1.0)) : 0.0;
}

// [samples] Standard deviation of the shift where the residual is white noise, by least squares: noise over
// the slope of the early signal. @param samples of all records
double deviationByNoise(const Top& top, double explained, double samples) {
  return top.curvature > 0.0 ? std::sqrt((1.0 - explained) / (explained * samples * top.curvature)) : 0.0;
}

void removeMean(Values& values) {
  const double level = mean(values);
  for (double& v : values) v -= level;
}

// [unit] Average of a signal over one period of a lower rate about a time; interpolated at a higher one.
double valueAt(const SampledSignal& signal, double time, double rate) {
  const double last = static_cast<double>(signal.values.size() - 1);
  const double centre = (time - signal.begin) * signal.rate;
  const double half = 0.5 * signal.rate / rate;
  const auto within = [&](double x) { return std::clamp(x, 0.0, last); };
  if (half > 1.0) {
    const auto from = static_cast<std::size_t>(within(std::ceil(centre - half)));
    const auto to = static_cast<std::size_t>(within(std::floor(centre + half)));
    double sum = 0.0;
    for (std::size_t i = from; i <= to; ++i) sum += signal.values[i];
    return sum / static_cast<double>(to - from + 1);
  }
  const double at = within(centre);
  const auto before = static_cast<std::size_t>(at);
  const std::size_t after = std::min(before + 1, signal.values.size() - 1);
  const double share = at - static_cast<double>(before);
  return (1.0 - share) * signal.values[before] + share * signal.values[after];
}

double endOf(const SampledSignal& signal) {
  return signal.begin + static_cast<double>(signal.values.size() - 1) / signal.rate;
}

// Taps.
constexpr double LEAST_PEAK = 20.0;  // [1] over the noise, which then moves an onset at a tenth of it little
constexpr double ONSET = 0.1, RISEN = 0.9;  // [1] of the peak
constexpr double OWN_PEAK = 0.1;            // [s] after the onset within which the peak of a tap lies
constexpr double SPACING = 0.2;             // [s] at least between two taps: the sensors ring in between
constexpr double WEAKEST = 0.2;             // [1] of the largest peak: weaker ones are no taps
constexpr double SAME = 5e-3;               // [s] within which shifts of taps agree

struct Tap {
  double onset, rise;  // [s]
};

// [s] at which a signal crosses a level between two samples, by linear interpolation.
double crossing(const SampledSignal& signal, const Values& sizes, std::size_t i, double level) {
  const double share =
      i > 0 && sizes[i] > sizes[i - 1] ? (sizes[i] - level) / (sizes[i] - sizes[i - 1]) : 0.0;
  return signal.begin + (static_cast<double>(i) - std::clamp(share, 0.0, 1.0)) / signal.rate;
}

std::vector<Tap> tapsOf(const SampledSignal& signal) {
  std::vector<Tap> taps;
  if (signal.values.size() < 3) return taps;
  Values sizes = signal.values;
  const double level = median(sizes);
  // Half of the distance of these percentiles is the standard deviation of noise; taps are short.
  const double noise = 0.5 * (percentile(sizes, 0.84) - percentile(sizes, 0.16));
  for (double& size : sizes) size = std::abs(size - level);
  const double largest = *std::max_element(sizes.begin(), sizes.end());
  if (!(largest > LEAST_PEAK * noise) || largest == 0.0) return taps;
  const double trigger = std::max(WEAKEST * largest, LEAST_PEAK * noise);
  const auto reach = static_cast<std::size_t>(OWN_PEAK * signal.rate) + 1;
  const auto spacing = static_cast<std::size_t>(SPACING * signal.rate) + 1;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    if (sizes[i] < trigger) continue;
    const std::size_t end = std::min(i + reach, sizes.size());
    const double peak = *std::max_element(sizes.begin() + static_cast<std::ptrdiff_t>(i),
                                          sizes.begin() + static_cast<std::ptrdiff_t>(end));
    std::size_t begin = i, risen = i;
    while (begin > 0 && sizes[begin - 1] >= ONSET * peak) --begin;
    while (risen + 1 < end && sizes[risen] < RISEN * peak) ++risen;
    // A tap that has begun before the record has no onset.
    if (begin > 0) {
      const double onset = crossing(signal, sizes, begin, ONSET * peak);
      taps.push_back({onset, crossing(signal, sizes, risen, RISEN * peak) - onset});
    }
    i += spacing;
  }
  return taps;
}

struct Matched {
  Values shifts;               // [s]
  double rise_difference = 0;  // [s] mean
};

Matched matchedBy(double shift, const std::vector<Tap>& late, const std::vector<Tap>& early) {
  Matched matched;
  for (const Tap& e : early) {
    const Tap* nearest = nullptr;
    double distance = SAME;
    for (const Tap& l : late) {
      const double own = std::abs(l.onset - e.onset - shift);
      if (own < distance) {
        distance = own;
        nearest = &l;
      }
    }
    if (!nearest) continue;
    matched.shifts.push_back(nearest->onset - e.onset);
    matched.rise_difference += nearest->rise - e.rise;
  }
  if (!matched.shifts.empty()) matched.rise_difference /= static_cast<double>(matched.shifts.size());
  return matched;
}

}  // namespace

std::optional<StreamShift> shiftByCorrelation(const std::vector<SignalPair>& records, double rate,
                                              const StreamShiftOptions& options) {
  const auto last = static_cast<std::size_t>(options.range * rate);
  std::vector<Sums> single;
  std::optional<Sums> all;
  double samples = 0.0;
  for (SignalPair pair : records) {
    if (pair.late.empty() || pair.late.size() != pair.early.size()) continue;
    removeMean(pair.late);
    removeMean(pair.early);
    samples += static_cast<double>(pair.late.size());
    single.push_back(sumsOf(pair, last));
    if (!all) all.emplace(last);
    all->add(single.back());
  }
  if (!all) return {};
  const std::size_t at = all->best();
  const double explained = all->explained(at);
  if (explained < options.min_explained || isAtAnEnd(*all, at) || isAmbiguous(*all, at, options)) return {};
  const Top top = topOf(*all, at);
  // Where records do not scatter, or there is only one, the noise remains.
  const double deviation =
      std::max(scatterOf(single, top.at, options), deviationByNoise(top, explained, samples));
  return StreamShift{(top.at - static_cast<double>(last)) / rate, std::hypot(deviation, ROUNDING) / rate,
                     explained, single.size()};
}

SignalPair onCommonTimes(const SampledSignal& late, const SampledSignal& early, double rate) {
  SignalPair pair;
  if (late.values.empty() || early.values.empty()) return pair;
  const double begin = std::max(late.begin, early.begin), end = std::min(endOf(late), endOf(early));
  if (end < begin) return pair;
  constexpr double ROUNDED = 1e-6;  // [samples] of stamps
  const auto samples = static_cast<std::size_t>((end - begin) * rate + ROUNDED) + 1;
  for (std::size_t i = 0; i < samples; ++i) {
    const double time = begin + static_cast<double>(i) / rate;
    pair.late.push_back(valueAt(late, time, rate));
    pair.early.push_back(valueAt(early, time, rate));
  }
  return pair;
}

std::optional<StreamShift> shiftByTaps(const SampledSignal& late, const SampledSignal& early,
                                       const StreamShiftOptions& options) {
  const std::vector<Tap> later = tapsOf(late), earlier = tapsOf(early);
  Matched best;
  bool ambiguous = false;
  for (const Tap& l : later) {
    for (const Tap& e : earlier) {
      const double shift = l.onset - e.onset;
      if (std::abs(shift) > options.range) continue;
      Matched matched = matchedBy(shift, later, earlier);
      const bool same = !best.shifts.empty() && std::abs(mean(best.shifts) - shift) < SAME;
      if (matched.shifts.size() > best.shifts.size()) {
        ambiguous = false;
        best = std::move(matched);
      } else if (matched.shifts.size() == best.shifts.size() && !same) {
        ambiguous = true;
      }
    }
  }
  if (best.shifts.empty() || ambiguous) return {};
  const auto count = static_cast<double>(best.shifts.size());
  const double scatter =
      count > 1.0 ? studentOverNormal(count - 1.0) * standardDeviation(best.shifts) / std::sqrt(count) : 0.0;
  const double rounding = ROUNDING * std::hypot(1.0 / late.rate, 1.0 / early.rate) / std::sqrt(count);
  return StreamShift{mean(best.shifts),
                     std::hypot(std::hypot(scatter, rounding), ROUNDING * best.rise_difference), 1.0,
                     best.shifts.size()};
}

}  // namespace smartmill
