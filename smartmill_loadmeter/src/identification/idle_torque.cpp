#include "smartmill_loadmeter/identification/idle_torque.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_loadmeter/calibration/friction_law.h"
#include "smartmill_loadmeter/calibration/load_meter.h"

namespace smartmill::loadmeter {
namespace {

/// [N m] Friction at the speed of a cut from the air cuts at this speed alone; empty without any. Their
/// rounding is the same in all of them, so that the mean is as certain as one.
std::optional<Estimate> idleTorqueAt(double speed, const std::vector<LoadTest>& air_cuts,
                                     const Spindle& spindle) {
  constexpr double SAME_SPEED = 0.05;  // [1] as two speeds of a fit must differ by more
  double weights = 0.0, sum = 0.0, deviation = 0.0, difference = 0.0;
  for (const LoadTest& air : air_cuts) {
    if (std::abs(air.speed - speed) > SAME_SPEED * speed || !(air.torqueStdAsVoltage() > 0.0)) continue;
    const double watt = spindle.load_meter_gain * air.speed, std_dev = air.torqueStdAsVoltage() / watt;
    const double weight = 1.0 / (std_dev * std_dev);
    weights += weight;
    sum += weight * air.voltage.mean / watt;
    deviation += weight * std_dev;
    difference = std::max(difference, std::abs(air.speed - speed));
  }
  if (!(weights > 0.0)) return std::nullopt;
  return Estimate{sum / weights, std::hypot(deviation / weights, difference * spindle.viscous)};
}

}  // namespace

IdleTorque idleTorque(const std::vector<LoadTest>& air_cuts, const Spindle& spindle,
                      double spindle_uncertainty_percent) {
  IdleTorque idle;
  Friction friction = modelFriction(spindle, spindle_uncertainty_percent);
  if (!air_cuts.empty()) {
    std::vector<AirCut> air;
    std::vector<TimedAirCut> timed;
    double first = air_cuts.front().stamp;
    for (const LoadTest& test : air_cuts) first = std::min(first, test.stamp);
    bool weighted = true;
    for (const LoadTest& test : air_cuts) {
      air.push_back({test.speed, test.voltage.mean, test.torqueStdAsVoltage()});
      timed.push_back({air.back(), test.stamp - first});
      weighted = weighted && air.back().voltage_std > 0.0;
    }
    friction = fitFriction(air, spindle.load_meter_gain, spindle.friction_zero_below);
    idle.viscous = friction.viscous;
    idle.coulomb = friction.coulomb;
    if (weighted && air.size() > FrictionTerms{true, false}.unknowns()) {
      const FittedFriction best =
          fitFrictionLaws(timed, spindle.load_meter_gain, spindle.friction_zero_below).front();
      if (best.terms.unknowns() > 2) {
        idle.viscous = best.law.viscous;
        idle.coulomb = best.law.coulomb;
        idle.unknowns = best.terms.unknowns();
        idle.covariance = best.covariance;
        idle.torque = [best, first](const LoadTest& t) { return best.law.torque(t.speed, t.stamp - first); };
        idle.gradient = [best, first](const LoadTest& t) {
          std::vector<double> slope;
          for (std::size_t i = 0; i < best.value.size(); ++i) {
            std::vector<double> v = best.value;
            const double step = 1e-5 * (std::abs(v[i]) + 1e-6);
            const auto at = [&](double value) {
              v[i] = value;
              return frictionLaw(best.terms, v.data(), best.law.zero_below).torque(t.speed, t.stamp - first);
            };
            slope.push_back((at(best.value[i] + step) - at(best.value[i] - step)) / (2.0 * step));
          }
          return slope;
        };
        return idle;
      }
    }
  }
  idle.unknowns = 2;
  idle.covariance.assign(friction.covariance.begin(), friction.covariance.end());
  idle.torque = [friction](const LoadTest& t) { return friction.at(t.speed); };
  idle.gradient = [friction](const LoadTest& t) {
    const std::array<double, 2> g = friction.gradient(t.speed);
    return std::vector<double>{g[0], g[1]};
  };
  return idle;
}

std::optional<Estimate> cuttingTorque(const LoadTest& cut, const std::vector<LoadTest>& air_cuts,
                                      const Spindle& spindle, double spindle_uncertainty_percent) {
  const double watt = spindle.load_meter_gain * cut.speed;
  try {
    const IdleTorque idle = idleTorque(air_cuts, spindle, spindle_uncertainty_percent);
    const std::vector<double> gradient = idle.gradient(cut);
    double variance = std::pow(cut.torqueStdAsVoltage() / watt, 2);
    for (std::size_t i = 0; i < idle.unknowns; ++i) {
      for (std::size_t j = 0; j < idle.unknowns; ++j) {
        variance += gradient[i] * idle.covariance[i * idle.unknowns + j] * gradient[j];
      }
    }
    return Estimate{cut.voltage.mean / watt - idle.torque(cut), std::sqrt(variance)};
  } catch (const Error&) {
    const std::optional<Estimate> idle = idleTorqueAt(cut.speed, air_cuts, spindle);
    if (!idle) return std::nullopt;
    return Estimate{cut.voltage.mean / watt - idle->value,
                    std::hypot(cut.torqueStdAsVoltage() / watt, idle->std_dev)};
  }
}

}  // namespace smartmill::loadmeter
