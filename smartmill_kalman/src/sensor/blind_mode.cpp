#include "smartmill_kalman/sensor/blind_mode.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Core>

#include "blind_residuals.h"
#include "smartmill_core/error.h"
#include "smartmill_core/fit/least_squares.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/window.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

/// Number of lines per independent line: powers of neighbours in a Hann window are correlated by (2/3)^2 and
/// (1/6)^2.
constexpr double CORRELATED = 1.0 + 2.0 * (4.0 / 9.0 + 1.0 / 36.0);

struct Fit {
  double f0 = 0.0, zeta = 0.0, share = 0.0, floor = 0.0;
  double cost = std::numeric_limits<double>::infinity();  // minus log-likelihood
};

/// Share and floor for a given resonance: reweighted least squares, the weights those of the exponential
/// distribution.
Fit fitLevels(const PowerLines& lines, double f0, double zeta) {
  Fit fit;
  fit.f0 = f0;
  fit.zeta = zeta;
  const double mean = lines.mean();
  double share = 0.0, floor = mean;
  std::vector<double> known;
  for (const double f : lines.frequency) known.push_back(resonance(f, f0, zeta));
  for (int pass = 0; pass < 12; ++pass) {
    double aa = 0, ab = 0, bb = 0, ay = 0, by = 0;
    for (std::size_t k = 0; k < known.size(); ++k) {
      const double w = 1.0 / std::pow(std::max(share * known[k] + floor, 1e-12 * mean), 2);
      aa += w * known[k] * known[k];
      ab += w * known[k];
      bb += w;
      ay += w * known[k] * lines.power[k];
      by += w * lines.power[k];
    }
    const double determinant = aa * bb - ab * ab;
    if (!(determinant > 0.0)) break;
    share = (ay * bb - by * ab) / determinant;
    floor = (by * aa - ay * ab) / determinant;
    if (share < 0.0) share = 0.0, floor = by / bb;
    if (floor < 0.0) floor = 0.0, share = ay / aa;
  }
  fit.share = share;
  fit.floor = floor;
  fit.cost = 0.0;
  for (std::size_t k = 0; k < known.size(); ++k) {
    const double s = std::max(share * known[k] + floor, 1e-12 * mean);
    fit.cost += std::log(s) + lines.power[k] / s;
  }
  return fit;
}

Eigen::VectorXd unknownsOf(const Fit& fit, double unit) {
  Eigen::VectorXd at(4);
  at << std::log(fit.f0), std::log(fit.zeta), fit.share / unit, fit.floor / unit;
  return at;
}

/// Maximum of the likelihood, from the best point of the grid.
Fit refined(const BlindResiduals& residuals, const Fit& start, double low, double high) {
  const Eigen::VectorXd at = unknownsOf(start, residuals.unit());
  std::vector<fit::Parameter> unknowns(4);
  for (Eigen::Index i = 0; i < 4; ++i) unknowns[static_cast<std::size_t>(i)].start = at[i];
  unknowns[0].low = std::log(0.9 * low);
  unknowns[0].high = std::log(1.1 * high);
  unknowns[1].low = std::log(1e-4);
  unknowns[1].high = std::log(0.5);
  unknowns[2].low = unknowns[3].low = 0.0;
  unknowns[2].scale = std::max(1e-6, at[2]);  // of a sharp resonance the share at rest is small
  fit::Options options;
  options.name = "blind mode";
  const fit::Result found = fit::minimise(residuals, unknowns, options);
  if (!found.usable()) return start;
  Fit best;
  best.f0 = std::exp(found.value[0]);
  best.zeta = std::exp(found.value[1]);
  best.share = residuals.unit() * found.value[2];
  best.floor = residuals.unit() * found.value[3];
  // The squares give the cost up to a constant, which follows from the start.
  Eigen::VectorXd before(residuals.count());
  residuals.evaluate(at, &before, nullptr);
  best.cost = start.cost + 0.5 * (found.squares - before.squaredNorm());
  return best.cost <= start.cost ? best : start;
}

/// Of log f0, log zeta, share and floor: inverse of the information of an exponentially distributed spectrum,
/// the sum of products of the log density's slopes.
fit::Covariance covarianceOf(const PowerLines& lines, const Fit& best, double unit) {
  const Eigen::VectorXd at = unknownsOf(best, unit);
  Eigen::MatrixXd slopes(static_cast<Eigen::Index>(lines.frequency.size()), 4);
  for (std::size_t k = 0; k < lines.frequency.size(); ++k) {
    const ExpectedPower expected = expectedPower(lines.frequency[k], at, unit);
    for (Eigen::Index i = 0; i < 4; ++i)
      slopes(static_cast<Eigen::Index>(k), i) = expected.slope[i] / expected.value / std::sqrt(CORRELATED);
  }
  return fit::covarianceOf(slopes);
}

}  // namespace

BlindMode findBlindMode(const std::vector<double>& samples, double sample_rate, double spindle_speed,
                        double low, double high, const BlindModeOptions& options) {
  const std::vector<double> window = hannWindow(samples.size());
  std::vector<double> windowed;
  for (std::size_t i = 0; i < samples.size(); ++i) windowed.push_back(window[i] * samples[i]);
  const auto spectrum = fourier(windowed);
  const std::vector<double> frequency = fourierFrequencies(samples.size(), sample_rate);
  const double line = sample_rate / static_cast<double>(samples.size());
  const double spindle = spindle_speed / units::TWO_PI;
  PowerLines lines;
  for (std::size_t k = 0; k < spectrum.size(); ++k) {
    if (frequency[k] < low || frequency[k] > high) continue;
    if (std::abs(frequency[k] - spindle * std::round(frequency[k] / spindle)) <= options.skirt * line)
      continue;
    lines.frequency.push_back(frequency[k]);
    lines.power.push_back(std::norm(spectrum[k]));
  }
  if (lines.power.size() < options.min_lines)
    throw Error("blind mode: too few lines between the harmonics of the spindle");

  Fit best;
  for (double f0 = low; f0 <= high; f0 *= 1.008) {
    for (double zeta = 0.003; zeta < 0.2; zeta *= 1.6) {
      const Fit fit = fitLevels(lines, f0, zeta);
      if (fit.cost < best.cost) best = fit;
    }
  }
  const BlindResiduals residuals(lines);
  best = refined(residuals, best, low, high);
  const fit::Covariance covariance = covarianceOf(lines, best, residuals.unit());
  const double flat = fitLevels(lines, 1e3 * high, 0.1).cost;  // no resonance in the band
  BlindMode result;
  result.mode.frequency = best.f0;
  result.mode.damping_ratio = best.zeta;
  result.mode.gain = std::numeric_limits<double>::quiet_NaN();
  result.mode.frequency_std = best.f0 * covariance.deviation(0);
  result.mode.damping_ratio_std = best.zeta * covariance.deviation(1);
  result.above = best.floor > 0.0 ? best.share * resonance(best.f0, best.f0, best.zeta) / best.floor
                                  : std::numeric_limits<double>::infinity();
  result.likelihood = (flat - best.cost) / CORRELATED;
  return result;
}

}  // namespace smartmill::kalman
