#include "smartmill_loadmeter/calibration/load_meter.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {

Friction fitFriction(const std::vector<AirCut>& air_cuts, double load_meter_gain, double zero_below) {
  bool weighted = true;
  for (const AirCut& cut : air_cuts) weighted = weighted && cut.voltage_std > 0.0;
  // Friction torque of each air cut, y = b omega + T_cf, with the weight of its standard deviation.
  double s = 0.0, sx = 0.0, sy = 0.0;
  int used = 0;
  const auto weightOf = [&](const AirCut& cut) {
    if (cut.speed < zero_below) return 0.0;
    const double sigma = weighted ? cut.voltage_std / (load_meter_gain * cut.speed) : 1.0;
    return 1.0 / (sigma * sigma);
  };
  const auto torqueOf = [&](const AirCut& cut) { return cut.voltage / (load_meter_gain * cut.speed); };
  double slowest = 0.0, fastest = 0.0;
  for (const AirCut& cut : air_cuts) {
    if (!(cut.speed > 0.0) || !std::isfinite(cut.voltage)) {
      throw Error("friction: air cut at " + std::to_string(cut.speed) +
                  " rad/s: expected a speed > 0 and a finite voltage");
    }
    const double w = weightOf(cut);
    if (w == 0.0) continue;
    slowest = used ? std::min(slowest, cut.speed) : cut.speed;
    fastest = used ? std::max(fastest, cut.speed) : cut.speed;
    ++used;
    s += w, sx += w * cut.speed, sy += w * torqueOf(cut);
  }
  if (used < 2 || !(fastest > slowest * 1.05)) {
    throw Error("friction: expected air cuts at two or more speeds, " + std::to_string(used) + " usable");
  }
  const double mean_x = sx / s, mean_y = sy / s;
  double sxx = 0.0, sxy = 0.0;
  for (const AirCut& cut : air_cuts) {
    const double w = weightOf(cut), x = cut.speed - mean_x;
    sxx += w * x * x;
    sxy += w * x * (torqueOf(cut) - mean_y);
  }
  Friction friction;
  friction.viscous = sxy / sxx;
  friction.coulomb = mean_y - friction.viscous * mean_x;
  friction.zero_below = zero_below;
  double scale = weighted ? 1.0 : 0.0;
  if (used > 2) {
    double chi2 = 0.0;
    for (const AirCut& cut : air_cuts) {
      const double residual = torqueOf(cut) - friction.at(cut.speed);
      chi2 += weightOf(cut) * residual * residual;
    }
    scale = weighted ? std::max(1.0, chi2 / (used - 2)) : chi2 / (used - 2);
  }
  friction.covariance = {scale / sxx, -scale * mean_x / sxx, -scale * mean_x / sxx,
                         scale * (1.0 / s + mean_x * mean_x / sxx)};
  return friction;
}

Friction modelFriction(const Spindle& spindle, double uncertainty_percent) {
  const double share = uncertainty_percent / 100.0;
  return {spindle.friction(),
          {std::pow(share * spindle.viscous, 2), 0.0, 0.0, std::pow(share * spindle.coulomb, 2)}};
}

double timeConstant(double bandwidth) {
  return 1.0 / (units::TWO_PI * bandwidth);
}

MeanVoltage meanVoltage(const std::vector<double>& readings, double interval, double time_constant,
                        double resolution) {
  if (readings.size() < 2) throw Error("load meter: expected two or more readings for a mean");
  const double n = static_cast<double>(readings.size());
  MeanVoltage result;
  for (const double v : readings) result.mean += v / n;
  double variance = 0.0, neighbours = 0.0, before = 0.0;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    const double d = readings[i] - result.mean;
    variance += d * d / (n - 1.0);
    if (i > 0) neighbours += d * before / (n - 1.0);
    before = d;
  }
  // Noise that passes the lag is correlated, rho after one interval, rho^2 after two; the meter's own noise
  // is not. The correlated share follows from neighbouring readings, r = share x rho, and n readings are
  // equivalent to n / (1 + 2 r / (1 - rho)) independent ones.
  const double rho = std::exp(-interval / time_constant);
  const double r = variance > 0.0 ? std::clamp(neighbours / variance, 0.0, rho) : 0.0;
  const double of_mean = variance * (1.0 + 2.0 * r / (1.0 - rho)) / n;
  // Without noise rounding shifts the mean by up to half a step; noise of some 0.4 steps removes the shift
  // (first term of the characteristic function of the rounding error). Readings on one or two steps do not
  // show such noise.
  const double step = resolution / std::sqrt(12.0);
  const auto [lowest, highest] = std::minmax_element(readings.begin(), readings.end());
  const bool spread = *highest - *lowest > 1.5 * resolution;
  const double noise2 = spread ? std::max(0.0, variance - step * step) : 0.0;
  const double rounding = step * std::exp(-2.0 * units::PI * units::PI * noise2 / (resolution * resolution));
  result.std_dev = std::sqrt(of_mean + rounding * rounding);
  return result;
}

}  // namespace smartmill::loadmeter
