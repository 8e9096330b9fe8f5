#include "smartmill_kalman/sensor/blind_mode.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Core>
#include <Eigen/LU>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/window.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

/// Lines of the Hann window's main lobe at each side of a harmonic, and some for a speed that is not exact.
constexpr double SKIRT = 4.0;
/// Powers of neighbouring lines of a Hann window are correlated, (2/3)^2 and (1/6)^2: so many lines count as
/// one.
constexpr double CORRELATED = 1.0 + 2.0 * (4.0 / 9.0 + 1.0 / 36.0);
constexpr std::size_t LEAST_LINES = 50;

struct Lines {
  std::vector<double> frequency, power;
};

/// Shape of the resonance, 1 at rest.
double shape(double f, double f0, double zeta) {
  const double r = f / f0;
  return 1.0 / ((1.0 - r * r) * (1.0 - r * r) + 4.0 * zeta * zeta * r * r);
}

struct Fit {
  double f0 = 0.0, zeta = 0.0, share = 0.0, floor = 0.0;
  double cost = std::numeric_limits<double>::infinity();  // minus log-likelihood
};

/// Share and floor for a given resonance: reweighted least squares, the weights those of the exponential
/// distribution.
Fit fitLevels(const Lines& lines, double f0, double zeta) {
  Fit fit;
  fit.f0 = f0;
  fit.zeta = zeta;
  double mean = 0.0;
  for (const double p : lines.power) mean += p / static_cast<double>(lines.power.size());
  double share = 0.0, floor = mean;
  std::vector<double> known;
  for (const double f : lines.frequency) known.push_back(shape(f, f0, zeta));
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

}  // namespace

BlindMode findBlindMode(const std::vector<double>& samples, double sample_rate, double spindle_speed,
                        double low, double high) {
  const std::vector<double> window = hannWindow(samples.size());
  std::vector<double> windowed;
  for (std::size_t i = 0; i < samples.size(); ++i) windowed.push_back(window[i] * samples[i]);
  const auto spectrum = fourier(windowed);
  const std::vector<double> frequency = fourierFrequencies(samples.size(), sample_rate);
  const double line = sample_rate / static_cast<double>(samples.size());
  const double spindle = spindle_speed / units::TWO_PI;
  Lines lines;
  for (std::size_t k = 0; k < spectrum.size(); ++k) {
    if (frequency[k] < low || frequency[k] > high) continue;
    if (std::abs(frequency[k] - spindle * std::round(frequency[k] / spindle)) <= SKIRT * line) continue;
    lines.frequency.push_back(frequency[k]);
    lines.power.push_back(std::norm(spectrum[k]));
  }
  if (lines.power.size() < LEAST_LINES) throw Error("blind mode: too few lines between those of the spindle");

  Fit best;
  for (double f0 = low; f0 <= high; f0 *= 1.008) {
    for (double zeta = 0.003; zeta < 0.2; zeta *= 1.6) {
      const Fit fit = fitLevels(lines, f0, zeta);
      if (fit.cost < best.cost) best = fit;
    }
  }
  double step_f = 0.004, step_zeta = 0.25;
  while (step_f > 1e-5) {
    Fit better = best;
    for (const double df : {-step_f, 0.0, step_f}) {
      for (const double dz : {-step_zeta, 0.0, step_zeta}) {
        const Fit fit = fitLevels(lines, best.f0 * (1.0 + df), std::min(0.5, best.zeta * (1.0 + dz)));
        if (fit.cost < better.cost) better = fit;
      }
    }
    if (better.cost < best.cost) {
      best = better;
    } else {
      step_f *= 0.5;
      step_zeta *= 0.5;
    }
  }

  // Information of an exponentially distributed spectrum: sum of products of the log density's slopes.
  Eigen::Matrix4d information = Eigen::Matrix4d::Zero();
  const auto logOf = [&](double f, double f0, double zeta, double share, double floor) {
    return std::log(share * shape(f, f0, zeta) + floor + 1e-300);
  };
  for (const double f : lines.frequency) {
    Eigen::Vector4d slope;
    const double e = 1e-5;
    const double base = logOf(f, best.f0, best.zeta, best.share, best.floor);
    slope(0) = (logOf(f, best.f0 * (1.0 + e), best.zeta, best.share, best.floor) - base) / (e * best.f0);
    slope(1) = (logOf(f, best.f0, best.zeta * (1.0 + e), best.share, best.floor) - base) / (e * best.zeta);
    slope(2) = (logOf(f, best.f0, best.zeta, best.share * (1.0 + e), best.floor) - base) / e;
    slope(3) = (logOf(f, best.f0, best.zeta, best.share, best.floor * (1.0 + e)) - base) / e;
    information += slope * slope.transpose() / CORRELATED;
  }
  const Eigen::Matrix4d covariance = information.fullPivLu().inverse();
  const double flat = fitLevels(lines, 1e3 * high, 0.1).cost;  // no resonance in the band
  BlindMode result;
  result.mode.frequency = best.f0;
  result.mode.damping_ratio = best.zeta;
  result.mode.gain = std::numeric_limits<double>::quiet_NaN();
  result.mode.frequency_std = std::sqrt(covariance(0, 0));
  result.mode.damping_ratio_std = std::sqrt(covariance(1, 1));
  result.above = best.floor > 0.0 ? best.share * shape(best.f0, best.f0, best.zeta) / best.floor
                                  : std::numeric_limits<double>::infinity();
  result.likelihood = (flat - best.cost) / CORRELATED;
  return result;
}

}  // namespace smartmill::kalman
