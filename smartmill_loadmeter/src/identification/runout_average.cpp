#include "runout_average.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace smartmill::loadmeter {

/// Fit at one offset and angle of the cutter axis.
struct RunoutAveraging::Point {
  double offset;
  std::size_t angle;
  LoadSolution solution;
  double evidence = 0.0;  // log likelihood up to a constant
};

RunoutAveraging::RunoutAveraging(const LoadRegression& regression, const LoadState& state, double largest,
                                 const RunoutAveragingOptions& options)
    : regression_(regression), options_(options), largest_(largest) {
  const Spindle& spindle = regression.spindle();
  const double time_constant = regression.timeConstantOf(state);
  double sum = 0.0, samples = 0.0;
  for (const LoadRecord& r : state.records) {
    if (r.cut) {
      effects_.emplace_back(r, spindle, time_constant, largest);
    } else {
      sum += r.samples * r.variance;
      samples += r.samples;
    }
  }
  const double rounding = std::pow(spindle.load_meter_resolution, 2) / 12.0;
  air_variance_known_ = samples > 0.0;
  air_variance_ = std::max(rounding, air_variance_known_ ? sum / samples : 0.0);
}

// Log likelihood of the readings' scatter given the ripple of a runout. With equal probability the scatter
// beyond that in air is ripple only, or a cut adds noise of unknown size.
double RunoutAveraging::scatterEvidence(const LoadState& state, const Point& point) const {
  const int sizes = options_.noises;
  std::vector<double> evidence(static_cast<std::size_t>(sizes) + 1, 0.0);
  double largest = 0.0;
  for (const LoadRecord& r : state.records) {
    if (r.cut && r.samples > 0.0) largest = std::max(largest, 2.0 * std::sqrt(r.variance));
  }
  if (!(largest > 0.0)) return 0.0;
  std::size_t cut = 0;
  for (const LoadRecord& r : state.records) {
    if (!r.cut) continue;
    const RunoutEffect& effect = effects_[cut++];
    if (!(r.samples > 0.0)) continue;
    RunoutEffect::Variance v =
        effect.variance(point.offset, point.angle, point.solution.ktc(), point.solution.kte());
    v.ripple *= r.in_cut;
    const double error = r.sparse ? options_.sparse_ripple_error : options_.ripple_error;
    for (int i = 0; i <= sizes; ++i) {
      const double noise = air_variance_ + std::pow(largest * i / sizes, 2);
      const double variance = 2.0 * noise * noise / r.samples +
                              4.0 * noise * v.ripple / (r.sparse ? options_.few_phases : r.samples) +
                              std::pow(error * v.ripple, 2) + (r.sparse ? std::pow(v.interference, 2) : 0.0);
      const double residual = r.variance - noise - v.ripple;
      evidence[static_cast<std::size_t>(i)] -= 0.5 * (residual * residual / variance + std::log(variance));
    }
  }
  const double best = *std::max_element(evidence.begin(), evidence.end());
  double with_noise = 0.0;
  for (int i = 1; i <= sizes; ++i)
    with_noise += std::exp(evidence[static_cast<std::size_t>(i)] - best) / sizes;
  const double ripple_only = air_variance_known_ ? std::exp(evidence[0] - best) : with_noise;
  return best + std::log(0.5 * (ripple_only + with_noise));
}

std::vector<RunoutAveraging::Point> RunoutAveraging::evaluate(const LoadState& state, double low,
                                                              double high) const {
  std::vector<Point> points;
  LoadState shifted = state;
  for (int o = 0; o < options_.offsets; ++o) {
    for (std::size_t a = 0; a < RunoutEffect::ANGLES; ++a) {
      Point p{low + (high - low) * o / (options_.offsets - 1), a, {}};
      std::size_t cut = 0;
      for (LoadRecord& r : shifted.records) {
        if (r.cut) r.mean_ratio = effects_[cut++].meanRatio(p.offset, a);
      }
      p.solution = regression_.solve(shifted, state.solution.terms, regression_.frictionOf(state.solution));
      points.push_back(p);
    }
  }
  double misfit = std::numeric_limits<double>::infinity();
  for (const Point& p : points) misfit = std::min(misfit, p.solution.misfit);
  for (Point& p : points) {
    p.evidence = scatterEvidence(state, p) - 0.5 * p.solution.fit.squares / std::max(1.0, misfit);
  }
  return points;
}

RunoutAverage RunoutAveraging::average(const LoadState& state) const {
  const auto largestOf = [](const std::vector<Point>& points) {
    return std::max_element(points.begin(), points.end(),
                            [](const Point& a, const Point& b) { return a.evidence < b.evidence; })
        ->evidence;
  };
  std::vector<Point> points = evaluate(state, 0.0, largest_);
  const double coarse = largestOf(points), step = largest_ / (options_.offsets - 1);
  double zero = -std::numeric_limits<double>::infinity(), low = largest_, high = 0.0;
  for (const Point& p : points) {
    if (p.offset == 0.0) zero = std::max(zero, p.evidence);
    if (p.evidence < coarse - options_.negligible) continue;
    low = std::min(low, p.offset);
    high = std::max(high, p.offset);
  }
  points = evaluate(state, std::max(0.0, low - step), std::min(largest_, high + step));
  const double best = largestOf(points);
  RunoutAverage average;
  average.is_significant = zero < best - options_.significant;
  double sum = 0.0;
  const auto weight = [&](const Point& p) { return std::exp(p.evidence - best); };
  for (const Point& p : points) {
    sum += weight(p);
    average.offset += weight(p) * p.offset;
    average.ktc += weight(p) * p.solution.ktc();
    average.kte += weight(p) * p.solution.kte();
  }
  average.offset /= sum;
  average.ktc /= sum;
  average.kte /= sum;
  for (const Point& p : points) {
    const double c = p.solution.ktc() - average.ktc, e = p.solution.kte() - average.kte;
    const double w = weight(p) / sum;
    average.variance_tc += w * c * c;
    average.variance_te += w * e * e;
    average.covariance += w * c * e;
  }
  return average;
}

void RunoutAveraging::applyOffset(double offset, LoadState* state) const {
  std::size_t cut = 0;
  for (LoadRecord& r : state->records) {
    if (r.cut) r.mean_ratio = effects_[cut++].meanRatio(offset);
  }
}

void RunoutAveraging::addAliasedVariance(const RunoutAverage& average, LoadState* state) const {
  std::size_t cut = 0;
  for (LoadRecord& r : state->records) {
    if (!r.cut) continue;
    const RunoutEffect& effect = effects_[cut++];
    const double aliased = effect.aliasedVariance(average.offset, average.ktc, average.kte, r.aliased_share);
    r.spread = std::hypot(r.spread, std::sqrt(aliased) / state->noise);
  }
}

}  // namespace smartmill::loadmeter
