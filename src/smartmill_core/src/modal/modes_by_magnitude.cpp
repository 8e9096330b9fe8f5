#include "modes_by_magnitude.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "smartmill_core/fit/least_squares.h"
#include "smartmill_core/signal/statistics.h"

namespace smartmill {
namespace {

using Eigen::Index;

std::optional<EstimatedMode> fitMagnitude(const ResidualModes& modes, const ModalEstimateOptions& options,
                                          const std::vector<double>& magnitude, std::size_t peak) {
  const WeightedLines& lines = modes.lines();
  EstimatedMode m;
  m.frequency = lines.frequency[peak];
  const ModalWindow w(modes.window(modes.spanOf({m}), {}), options, lines.size());
  const std::vector<double>& f = w.lines().frequency;
  const auto first = static_cast<std::size_t>(
      std::lower_bound(lines.frequency.begin(), lines.frequency.end(), f.front()) - lines.frequency.begin());
  const auto count = static_cast<Index>(f.size());
  // log |H| = log a + log |unitMode|, with the best a
  const fit::FunctionResiduals residuals(count, [&](const Eigen::VectorXd& at, Eigen::VectorXd& difference) {
    for (Index i = 0; i < count; ++i) {
      const auto k = static_cast<std::size_t>(i);
      difference[i] =
          std::log(magnitude[first + k] / std::abs(unitMode(f[k], std::exp(at[0]), std::exp(at[1]))));
    }
    difference.array() -= difference.mean();
  });
  const double line = lines.step() / m.frequency, at = std::log(m.frequency);
  const double narrowest = std::log(0.02 * line), widest = std::log(0.1);
  fit::Options fit_options;
  fit_options.name = "mode by magnitude";
  const fit::Parameter frequency_parameter{at, at - 2.0 * line, at + 2.0 * line, line};
  fit::Result found = fit::minimise(
      residuals, {frequency_parameter, {std::log(0.5 * line), narrowest, widest, 0.3}}, fit_options);
  if (!found.usable()) return std::nullopt;
  Eigen::VectorXd plain(count);
  for (Index i = 0; i < count; ++i) plain[i] = std::log(magnitude[first + static_cast<std::size_t>(i)]);
  plain.array() -= plain.mean();
  const double variance = found.squares / static_cast<double>(count - 3);
  const double height = plain[static_cast<Index>(peak - first)];
  const double evidence = (plain.squaredNorm() - height * height - found.squares) / variance / w.limit(2);
  if (!(evidence >= options.search.proven)) return std::nullopt;
  // A peak narrower than the line spacing only gives an upper bound of the damping: the mean over all values
  // weighted by the misfit.
  double weights = 0.0, mean = 0.0, square = 0.0;
  for (int i = 0; i <= options.search.dampings; ++i) {
    const double damping = narrowest + (widest - narrowest) * i / options.search.dampings;
    const double squares =
        fit::minimise(residuals, {frequency_parameter, {damping, damping, damping, 1.0}}, fit_options)
            .squares -
        found.squares;
    const double zeta = std::exp(damping), weight = zeta * std::exp(-0.5 * std::max(squares, 0.0) / variance);
    weights += weight;
    mean += weight * zeta;
    square += weight * zeta * zeta;
  }
  mean /= weights;
  const fit::Covariance covariance = fit::covarianceOf(found.jacobian);
  found.value[1] = std::log(mean);
  m = describeMode(w, w.assess(PoleList{found.value}), 0);
  const double log_frequency_std = std::sqrt(variance) * covariance.deviation(0);
  m.frequency_std = m.frequency * (log_frequency_std > 0.0 ? std::min(log_frequency_std, line) : line);
  m.damping_ratio_std = std::sqrt(std::max(square / weights - mean * mean, std::pow(0.01 * mean, 2)));
  m.evidence = evidence;
  return m;
}

}  // namespace

void addByMagnitude(ResidualModes& modes, const ModalEstimateOptions& options) {
  const WeightedLines& lines = modes.lines();
  const std::size_t n = lines.size();
  std::vector<double> magnitude(n, 0.0);
  for (std::size_t o = 0; o < lines.frfs(); ++o) {
    for (std::size_t i = 0; i < n; ++i) magnitude[i] += std::norm(lines.value[o][i]);
  }
  for (double& m : magnitude) m = std::sqrt(m);
  for (std::size_t i = 4; i + 4 < n; ++i) {
    const auto begin = magnitude.begin() +
                       static_cast<std::ptrdiff_t>(i > options.search.about ? i - options.search.about : 0);
    const auto end =
        magnitude.begin() + static_cast<std::ptrdiff_t>(std::min(n, i + options.search.about + 1));
    if (magnitude[i] < *std::max_element(begin, end) ||
        magnitude[i] < options.search.clear_peak * median({begin, end}))
      continue;
    const double f = lines.frequency[i], margin = 4.0 * lines.step();
    // Where the force has no power, noise looks like a peak.
    double noise = 0.0;
    for (std::size_t o = 0; o < lines.frfs(); ++o) noise += 2.0 / (lines.weight[o][i] * lines.weight[o][i]);
    if (magnitude[i] < options.search.clear_peak * std::sqrt(noise)) continue;
    const auto here = [&](const EstimatedMode& m) {
      return std::abs(m.frequency - f) < margin + m.frequency * m.damping_ratio;
    };
    if (std::any_of(modes.modes().begin(), modes.modes().end(),
                    [&](const EstimatedMode& m) { return here(m) && m.evidence >= options.search.proven; }))
      continue;
    if (const auto fitted = fitMagnitude(modes, options, magnitude, i))
      modes.replaceByMagnitude(here, *fitted);
  }
}

}  // namespace smartmill
