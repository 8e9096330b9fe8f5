#include "smartmill_loadmeter/calibration/machine_calibration.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {

namespace {

double rounding(double resolution) {
  return resolution / std::sqrt(12.0);
}

}  // namespace

IdleVoltage fitIdleVoltage(const std::vector<AirCut>& air_cuts, double zero_below, double resolution) {
  double s2 = 0.0, s3 = 0.0, s4 = 0.0, y1 = 0.0, y2 = 0.0;
  std::size_t used = 0;
  for (const AirCut& cut : air_cuts) {
    const double w = cut.speed;
    if (w < zero_below) continue;
    ++used;
    s2 += w * w, s3 += w * w * w, s4 += w * w * w * w;
    y1 += w * cut.voltage, y2 += w * w * cut.voltage;
  }
  const double determinant = s4 * s2 - s3 * s3;
  if (used < 2 || !(determinant > 1e-9 * s4 * s2)) {
    throw Error("idle voltage: air cuts at two or more speeds are due, " + std::to_string(used) + " usable");
  }
  IdleVoltage idle;
  idle.kb.value = (s2 * y2 - s3 * y1) / determinant;
  idle.ktcf.value = (s4 * y1 - s3 * y2) / determinant;
  double rest2 = 0.0;
  for (const AirCut& cut : air_cuts) {
    if (cut.speed >= zero_below) rest2 += std::pow(cut.voltage - idle.at(cut.speed), 2);
  }
  double variance = rounding(resolution) * rounding(resolution);
  if (used > 2) variance = std::max(variance, rest2 / static_cast<double>(used - 2));
  idle.kb.std_dev = std::sqrt(variance * s2 / determinant);
  idle.ktcf.std_dev = std::sqrt(variance * s4 / determinant);
  idle.covariance = -variance * s3 / determinant;
  return idle;
}

MachineCalibration calibrateLoadMeter(const IdleVoltage& idle, const std::vector<ReferenceCut>& cuts,
                                      double zero_below, double resolution) {
  if (cuts.empty()) throw Error("load meter: no reference cut with a known torque");
  MachineCalibration c;
  c.idle = idle;
  const auto idleAt = [&](double speed) { return speed < zero_below ? 0.0 : idle.at(speed); };
  // Straight line through zero of (V - V_f) / T_c over w.
  double xx = 0.0, xy = 0.0, by_kb = 0.0, by_ktcf = 0.0, from_torque = 0.0, from_rounding = 0.0;
  for (const ReferenceCut& cut : cuts) {
    if (!(std::abs(cut.torque) > 0.0) || !(cut.speed > 0.0)) {
      throw Error("load meter: a reference cut needs a torque and a speed");
    }
    const double ratio = (cut.voltage - idleAt(cut.speed)) / cut.torque, w = cut.speed;
    xx += w * w;
    xy += w * ratio;
    if (w >= zero_below) {
      by_kb -= w * w * w / cut.torque;
      by_ktcf -= w * w / cut.torque;
    }
    from_torque += std::pow(w * ratio * cut.torque_std / cut.torque, 2);
    from_rounding += std::pow(w * rounding(resolution) / cut.torque, 2);
  }
  c.gain.value = xy / xx;
  double rest2 = 0.0;
  for (const ReferenceCut& cut : cuts) {
    rest2 += std::pow((cut.voltage - idleAt(cut.speed)) / cut.torque - c.gain.value * cut.speed, 2);
  }
  const double n = static_cast<double>(cuts.size());
  const double scatter = n > 1.0 ? rest2 / (n - 1.0) * xx : 0.0;
  by_kb /= xx, by_ktcf /= xx;
  const double shared = by_kb * by_kb * idle.kb.std_dev * idle.kb.std_dev +
                        by_ktcf * by_ktcf * idle.ktcf.std_dev * idle.ktcf.std_dev +
                        2.0 * by_kb * by_ktcf * idle.covariance;
  const double own = std::max(from_torque + from_rounding, scatter) / (xx * xx);
  c.gain.std_dev = std::sqrt(own + shared);
  const double k = c.gain.value;
  c.viscous.value = idle.kb.value / k;
  c.coulomb.value = idle.ktcf.value / k;
  c.viscous.std_dev = std::hypot(idle.kb.std_dev / k, c.viscous.value * c.gain.std_dev / k);
  c.coulomb.std_dev = std::hypot(idle.ktcf.std_dev / k, c.coulomb.value * c.gain.std_dev / k);
  return c;
}

ExitFit fitExit(const std::vector<double>& voltage, double interval, double resolution) {
  const std::size_t n = voltage.size();
  if (n < 12)
    throw Error("load meter: the record of the exit has " + std::to_string(n) + " samples, 12 are due");
  const auto part = [&](std::size_t from, std::size_t to) {
    return mean(std::vector<double>(voltage.begin() + static_cast<std::ptrdiff_t>(from),
                                    voltage.begin() + static_cast<std::ptrdiff_t>(to)));
  };
  const std::size_t tenth = std::max<std::size_t>(3, n / 10);
  const double before = part(0, tenth), after = part(n - tenth, n), fall = before - after;
  if (!(fall > 4.0 * resolution)) {
    throw Error("load meter: the record of the exit shows no fall of four steps or more");
  }
  // From where it has fallen by a fifth to where it has by 1 - exp(-1): guesses for the fit.
  std::size_t begin = 0, down = n - 1;
  for (std::size_t i = n; i-- > 0;) {
    if (voltage[i] > after + 0.8 * fall) {
      begin = i;
      break;
    }
  }
  for (std::size_t i = begin; i < n; ++i) {
    if (voltage[i] < after + 0.37 * fall) {
      down = i;
      break;
    }
  }
  const double length = interval * static_cast<double>(n - 1);
  const double guess = std::max(interval, static_cast<double>(down - begin) * interval);
  const auto model = [&](const std::vector<double>& v, double t) {
    return t <= v[2] ? v[0] : v[1] + (v[0] - v[1]) * std::exp(-(t - v[2]) / v[3]);
  };
  const auto residuals = [&](const std::vector<double>& v, double* out) {
    for (std::size_t i = 0; i < n; ++i)
      *out++ = (voltage[i] - model(v, static_cast<double>(i) * interval)) / resolution;
  };
  const double start = static_cast<double>(begin) * interval;
  FitResult best;
  // The time of the exit is a kink: started on both sides.
  for (const double early : {0.0, 0.25, 0.6}) {
    const FitResult tried = fit(residuals, n,
                                {{before, before - 2.0 * fall, before + 2.0 * fall, fall},
                                 {after, after - 2.0 * fall, after + 2.0 * fall, fall},
                                 {std::max(0.0, start - early * guess), -0.1 * length, length, guess},
                                 {guess, 0.05 * interval, 10.0 * length, guess}});
    if (best.value.empty() || tried.squares < best.squares) best = tried;
  }
  const double freedom = static_cast<double>(n) - 4.0;
  // Rounding of a smooth fall is spread by the fall itself; only the levels may stand on one step throughout.
  const double variance = std::max(best.squares / freedom, 1.0 / 12.0);
  ExitFit result;
  result.before = best.value[0];
  result.after = best.value[1];
  result.exit_time = {best.value[2], std::sqrt(variance * best.covarianceOf(2, 2))};
  const double tau = best.value[3];
  const double level =
      rounding(resolution) / fall;  // share by which a level that noise does not dither is off
  result.bandwidth.value = 1.0 / (units::TWO_PI * tau);
  const double noise2 = std::max(0.0, best.squares / freedom - 1.0 / 12.0);
  const double undithered = std::exp(-2.0 * units::PI * units::PI * noise2);
  result.bandwidth.std_dev =
      result.bandwidth.value *
      std::hypot(std::sqrt(variance * best.covarianceOf(3, 3)) / tau, level * undithered);
  result.noise = resolution * std::sqrt(best.squares / freedom);
  return result;
}

}  // namespace smartmill::loadmeter
