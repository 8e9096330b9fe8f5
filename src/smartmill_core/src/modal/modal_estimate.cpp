#include "smartmill_core/modal/modal_estimate.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "modal_doubts.h"
#include "modal_residuals.h"
#include "modal_search.h"
#include "modes_by_magnitude.h"
#include "smartmill_core/error.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

using Complex = std::complex<double>;

/// Lines on each side over which noise counts as uniform.
constexpr std::size_t SIDE = 25;
constexpr std::size_t LEAST_LINES = 12;
/// Significance of the sense of rotation, in standard deviations.
constexpr double CLEARLY = 3.0;
/// Least noise of a line, as share of the tallest: rounding in files and in the solver.
constexpr double DIGITS = 1e-7;

std::vector<double> noiseOf(const FrequencyResponse& band) {
  const bool stated =
      band.std_dev.size() == band.size() && std::all_of(band.std_dev.begin(), band.std_dev.end(),
                                                        [](double d) { return std::isfinite(d) && d > 0.0; });
  return stated ? smoothedDeviation(band.std_dev) : lineNoise(band.value);
}

WeightedLines weighted(const std::vector<FrequencyResponse>& frfs, const ModalEstimateOptions& options,
                       bool conjugated) {
  WeightedLines lines;
  for (const FrequencyResponse& frf : frfs) {
    const double high = options.high > 0.0 ? options.high : frf.frequency.back();
    const FrequencyResponse band = frf.band(std::max(options.low, 1e-12), high);
    if (band.size() < LEAST_LINES) {
      throw Error("modes: " + std::to_string(band.size()) + " lines between " + std::to_string(options.low) +
                  " and " + std::to_string(high) + " Hz are too few");
    }
    if (lines.frfs() > 0 && band.frequency != lines.frequency)
      throw Error("modes: expected FRFs with the same lines");
    lines.frequency = band.frequency;
    double tallest = 0.0;
    for (std::size_t i = 0; i < band.size(); ++i) {
      if (!std::isfinite(std::abs(band.value[i])))
        throw Error("modes: the FRF is not finite at " + std::to_string(band.frequency[i]) + " Hz");
      tallest = std::max(tallest, std::abs(band.value[i]));
    }
    if (!(tallest > 0.0)) throw Error("modes: the FRF is zero in the band");
    std::vector<double> weight = noiseOf(band);
    for (double& w : weight) w = std::sqrt(2.0) / std::max(w, DIGITS * tallest);
    lines.weight.push_back(std::move(weight));
    lines.value.push_back(band.value);
    if (!conjugated) continue;
    for (Complex& v : lines.value.back()) v = std::conj(v);
  }
  return lines;
}

/// Weights for start values, limited by the misfit.
WeightedLines tempered(const WeightedLines& lines, double start_misfit) {
  WeightedLines result = lines;
  for (std::size_t o = 0; o < lines.frfs(); ++o) {
    for (std::size_t i = 0; i < lines.size(); ++i) {
      const double noise = 1.0 / lines.weight[o][i], misfit = start_misfit * std::abs(lines.value[o][i]);
      result.weight[o][i] = 1.0 / std::hypot(noise, misfit);
    }
  }
  return result;
}

/// Subtracts the mass line of a free structure, whose curvature over the lowest narrow modes exceeds that of
/// the background parabola. It is recognised by a constant acceleration of the first lines, from near zero.
WeightedLines withoutMassLine(const WeightedLines& lines, const ModalSearchOptions& options) {
  WeightedLines result = lines;
  if (lines.frequency[LEAST_LINES - 1] < options.from_zero * lines.frequency[0]) return result;
  for (std::size_t o = 0; o < lines.frfs(); ++o) {
    std::vector<double> accelerance, off;
    for (std::size_t i = 0; i < LEAST_LINES; ++i)
      accelerance.push_back(lines.value[o][i].real() * std::pow(units::TWO_PI * lines.frequency[i], 2));
    const double level = median(accelerance);
    for (const double a : accelerance) off.push_back(std::abs(a - level));
    if (median(off) > options.mass_line * std::abs(level)) continue;
    for (std::size_t i = 0; i < lines.size(); ++i)
      result.value[o][i] -= level / std::pow(units::TWO_PI * lines.frequency[i], 2);
  }
  return result;
}

void merge(std::vector<Pole>& all, const std::vector<Pole>& more, double line) {
  for (const Pole& p : more) {
    const bool known = std::any_of(all.begin(), all.end(), [&](const Pole& q) {
      const double width = std::min(p.halfWidth(), q.halfWidth()) + 0.1 * line;
      return std::abs(p.frequency - q.frequency) < 0.2 * width &&
             std::abs(std::log(p.damping_ratio / q.damping_ratio)) < 0.4;
    });
    if (!known) all.push_back(p);
  }
}

/// Stable poles of the band's halves, quarters, ..., which overlap by half; only poles inside count.
bool addParts(const WeightedLines& lines, const ModalEstimateOptions& options,
              std::vector<Pole>& candidates) {
  const std::size_t n = lines.size();
  for (std::size_t part = n / 4; part >= options.search.least_part; part /= 4) {
    for (std::size_t first = 0; first + part <= n; first += part / 2) {
      if (options.progress && !options.progress(0.05)) return false;
      const PoleSearch search{first, std::min(n, first + part), options.search.part_order,
                              options.search.part_order_step};
      const std::size_t quarter = part / 4;
      const double low = first == 0 ? 0.0 : lines.frequency[first + quarter];
      const double high =
          first + part + part / 2 > n ? lines.frequency.back() : lines.frequency[first + 3 * quarter];
      std::vector<Pole> inside;
      for (const Pole& p : persistentPoles(polesByOrder(lines, search), search)) {
        if (p.frequency < low || p.frequency > high) continue;
        inside.push_back(p);
        // Converts the persistence over few orders to the scale of the whole band.
        inside.back().order = p.order * options.largest_order * options.search.part_order_step /
                              options.search.part_order / options.search.part_worth;
      }
      merge(candidates, inside, lines.step());
    }
  }
  return true;
}

/// Starts a search with the poles that persist over the orders. Where some of them remain without a mode, a
/// second search starts with all candidates: in dense bands weak poles are the missing neighbours of the
/// persistent ones. The search that matches more of the persistent poles is kept.
bool begin(ModalSearch& search, const std::vector<Pole>& candidates, int largest_order, int steady_share) {
  std::vector<Pole> steady;
  for (const Pole& p : candidates) {
    if (p.order * steady_share >= largest_order) steady.push_back(p);
  }
  ModalSearch dense = search;
  if (!search.startWith(steady) || !search.refitAll(1, false)) return false;
  if (search.countUnmatched(steady) == 0 || steady.size() == candidates.size()) return true;
  if (!dense.startWith(candidates) || !dense.refitAll(1, false)) return false;
  if (dense.countUnmatched(steady) < search.countUnmatched(steady)) search.continueFrom(std::move(dense));
  return true;
}

/// Lower and upper residual terms of the residual of modes and doubts, by least squares.
ResidualTerms residualTermsOf(const WeightedLines& lines, const ModalEstimate& estimate, std::size_t o) {
  const double reference = units::TWO_PI * lines.frequency[lines.size() / 2];
  double a = 0.0, b = 0.0, c = 0.0;  // normal equations of (1, -(reference / w)^2)
  Complex one, two;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const double w = lines.weight[o][i] * lines.weight[o][i];
    const double mass = -std::pow(reference / (units::TWO_PI * lines.frequency[i]), 2);
    Complex residual = lines.value[o][i];
    for (const std::vector<EstimatedMode>* modes : {&estimate.modes, &estimate.doubts}) {
      for (const EstimatedMode& m : *modes) residual -= m.response(o, lines.frequency[i]);
    }
    a += w;
    b += w * mass;
    c += w * mass * mass;
    one += w * residual;
    two += w * mass * residual;
  }
  const double determinant = a * c - b * b;
  if (!(determinant > 1e-12 * a * c)) return {one / a, 0.0};
  return {(c * one - b * two) / determinant, (a * two - b * one) / determinant * reference * reference};
}

}  // namespace

Complex ResidualTerms::response(double f) const {
  const double w = units::TWO_PI * f;
  return upper - lower / (w * w);
}

Complex fittedResponse(const ModalEstimate& estimate, std::size_t frf, double f) {
  Complex sum = estimate.residual_terms[frf].response(f);
  for (const EstimatedMode& m : estimate.modes) sum += m.response(frf, f);
  for (const EstimatedMode& m : estimate.doubts) sum += m.response(frf, f);
  return estimate.conjugated ? std::conj(sum) : sum;
}

Complex EstimatedMode::response(std::size_t frf, double f) const {
  return Complex(gain[frf], phase_part[frf] * f / frequency) * unitMode(f, frequency, damping_ratio);
}

std::vector<double> lineNoise(const std::vector<Complex>& value) {
  const std::size_t n = value.size();
  std::vector<double> bend(n), noise(n);
  // Third differences vanish for a parabola.
  for (std::size_t i = 1; i + 2 < n; ++i)
    bend[i] = std::abs(value[i + 2] - 3.0 * value[i + 1] + 3.0 * value[i] - value[i - 1]) / std::sqrt(20.0);
  if (n < 4) return noise;
  bend[0] = bend[1];
  bend[n - 2] = bend[n - 1] = bend[n - 3];
  for (std::size_t i = 0; i < n; ++i) {
    const auto first = static_cast<std::ptrdiff_t>(i > SIDE ? i - SIDE : 0);
    const auto last = static_cast<std::ptrdiff_t>(std::min(n, i + SIDE + 1));
    // The median of a Rayleigh variable is sqrt(ln 2) times its root mean square.
    noise[i] = median({bend.begin() + first, bend.begin() + last}) / std::sqrt(std::log(2.0));
  }
  return noise;
}

bool hasReversedPhase(const std::vector<FrequencyResponse>& frfs) {
  double clearest = 0.0;
  // The curvature of wide peaks is below the noise of single lines: averages over 1, 2, 4, ... lines.
  for (std::size_t group = 1; group <= 256; group *= 2) {
    double turn = 0.0, squares = 0.0;
    for (const FrequencyResponse& frf : frfs) {
      std::vector<Complex> mean(frf.size() / group);
      for (std::size_t i = 0; i < mean.size() * group; ++i) mean[i / group] += frf.value[i];
      for (std::size_t i = 1; i + 1 < mean.size(); ++i) {
        // The circle of a resonance curves to the right; a delay rotates with little curvature.
        const double bend = (std::conj(mean[i] - mean[i - 1]) * (mean[i + 1] - mean[i])).imag();
        turn += bend;
        squares += bend * bend;
      }
    }
    if (squares > 0.0 && std::abs(turn) > std::abs(clearest) * std::sqrt(squares))
      clearest = turn / std::sqrt(squares);
  }
  return clearest > CLEARLY;
}

ModalEstimate estimateModes(const std::vector<FrequencyResponse>& frfs, const ModalEstimateOptions& options) {
  if (frfs.empty()) throw Error("modes: no FRF");
  ModalEstimate result;
  std::vector<FrequencyResponse> bands;
  for (const FrequencyResponse& frf : frfs)
    bands.push_back(frf.band(options.low, options.high > 0.0 ? options.high : INFINITY));
  result.conjugated = hasReversedPhase(bands);
  const WeightedLines lines = weighted(frfs, options, result.conjugated);
  const WeightedLines start = tempered(lines, options.search.start_misfit);
  const int most = static_cast<int>(lines.size() / 4);
  const PoleSearch whole{0, lines.size(), std::max(2, std::min(options.largest_order, most)), 1};
  result.diagram = polesByOrder(start, whole);
  std::vector<Pole> candidates = persistentPoles(result.diagram, whole);
  const WeightedLines searched = withoutMassLine(lines, options.search);
  ModalSearch search(searched, options);
  result.cancelled =
      !(addParts(start, options, candidates) &&
        begin(search, candidates, whole.largest_order, options.search.steady_share) &&
        search.addCandidates(candidates) && search.addAtLargestResidual(10) && search.refitAll(2, true));
  addByMagnitude(search.found(), options);
  result.modes = search.results(true);
  result.doubts = search.results(false);
  judgeModes(bands, options.search, result);
  for (std::size_t o = 0; o < lines.frfs(); ++o)
    result.residual_terms.push_back(residualTermsOf(start, result, o));
  return result;
}

}  // namespace smartmill
