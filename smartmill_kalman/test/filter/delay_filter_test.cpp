#include "smartmill_kalman/filter/delay_filter.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Core>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/filter/riccati.h"
#include "smartmill_kalman_testing/reference_case.h"

namespace smartmill::kalman {
namespace {

constexpr double RATE = 25600.0;  // [Hz]

// Without measurements the line repeats for ever: a harmonic keeps its phase to the closed form although T is
// no whole number of samples, and drives the modes to their steady answer.
TEST(DelayModel, RepeatsWithAPeriodBetweenSamples) {
  const ModalModel sensor = ReferenceCase::exactSensor();
  const double samples = 70.621, frequency = 3.0 * RATE / samples;  // third harmonic, 1087 Hz
  const DelayModel model(sensor, samples / RATE, RATE);
  const auto wave = [&](double k) { return std::polar(1.0, units::TWO_PI * frequency * k / RATE); };
  std::vector<double> state(model.states(), 0.0);
  for (std::size_t i = 0; i < model.line; ++i)
    state[2 * model.modes + i] = wave(static_cast<double>(i) - static_cast<double>(DelayModel::NOW)).real();
  double worst_force = 0.0, worst_measured = 0.0;
  for (int k = 0; k < 3000; ++k) {
    worst_force = std::max(worst_force, std::abs(state[2 * model.modes + DelayModel::NOW] - wave(k).real()));
    if (k > 2000) {
      const double steady = (sensor.response(frequency) * wave(k)).real();
      worst_measured = std::max(worst_measured, std::abs(model.measured(state) - steady));
    }
    model.step(state);
  }
  // 16 points at 0.085 of the half rate: the 42 revolutions lose nothing that shows; the hold's polynomial
  // of 8 points errs by 1e-6 there, times a response of at most 15.
  EXPECT_LT(worst_force, 1e-8);
  EXPECT_LT(worst_measured, 2e-5);
}

// What is never amplified cannot run away: at every frequency the loop's gain is at most 1, and a 5 kHz
// harmonic loses less than 0.1 % a revolution even half-way between samples.
TEST(DelayModel, LoopIsPassive) {
  for (const double samples : {40.0, 40.25, 40.5, 40.8}) {
    const DelayModel model(ReferenceCase::exactSensor(), samples / RATE, RATE);
    for (double f = 0.0; f <= 0.5 * RATE; f += 100.0) {
      std::complex<double> sum = 0.0;
      for (std::size_t j = 0; j < DelayModel::TAPS; ++j)
        sum += model.interpolate[j] * std::polar(1.0, units::TWO_PI * f / RATE * static_cast<double>(j));
      EXPECT_LE(std::abs(sum), 1.0 + 1e-9) << samples << " " << f;
      if (f <= 5000.0) {
        EXPECT_GT(std::abs(sum), 0.999) << samples << " " << f;
      }
    }
  }
}

// The fast recursion ends at the solution of the Riccati equation.
TEST(DelayGain, IsTheRiccatiEquationsGain) {
  const DelayModel model(ReferenceCase::exactSensor(), 20.37 / RATE, RATE);
  const auto n = static_cast<Eigen::Index>(model.states());
  Eigen::MatrixXd phi(n, n), q = Eigen::MatrixXd::Zero(n, n);
  Eigen::RowVectorXd c(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    std::vector<double> unit(model.states(), 0.0);
    unit[static_cast<std::size_t>(i)] = 1.0;
    c(i) = model.measured(unit);
    model.step(unit);
    phi.col(i) = Eigen::Map<const Eigen::VectorXd>(unit.data(), n);
  }
  q(n - 1, n - 1) = 0.25;
  const double r = 2.0;
  const Eigen::MatrixXd p = stationaryCovariance(phi, q, c, r);
  const double variance = (c * p * c.transpose())(0) + r;
  const Eigen::VectorXd gain = p * c.transpose() / variance;
  const std::vector<double> fast = delayGain(model, 0.25, r);
  EXPECT_NEAR(fast.back(), variance, 1e-5 * variance);
  for (Eigen::Index i = 0; i < n; ++i)
    EXPECT_NEAR(fast[static_cast<std::size_t>(i)], gain(i), 1e-5 * gain.lpNorm<Eigen::Infinity>()) << i;
}

TEST(DelayFilter, RecoversHarmonicsThroughTheSensor) {
  const ModalModel sensor = ReferenceCase::exactSensor();
  const double speed = units::radPerSecFromRpm(21750.0);  // 70.62 samples a revolution
  DelayFilter filter(sensor, speed, RATE, {});
  double worst = 0.0;
  for (int i = 0; i < 51200; ++i) {
    const double t = i / RATE;
    double applied = 50.0, measured = 50.0;
    for (const auto& [n, amplitude] : {std::pair(1, 30.0), std::pair(4, 100.0), std::pair(8, 20.0)}) {
      const auto wave = std::polar(amplitude, n * speed * t);
      applied += wave.real();
      measured += (sensor.response(n * speed / units::TWO_PI) * wave).real();
    }
    const double estimate = filter.step(measured);
    if (t > 1.5) worst = std::max(worst, std::abs(estimate - applied));
  }
  // 2900 Hz: a hold of 8 points at 0.23 of the half rate errs by some 1e-4 of 20 N.
  EXPECT_LT(worst, 0.02);
}

// A zero of the sensor passes next to nothing at one harmonic: there is a gain all the same, and what is
// passed comes back.
TEST(DelayFilter, BearsAZeroOfTheSensor) {
  ModalModel sensor;
  sensor.modes = {{1130.0, 0.035, 0.9}};
  sensor.direct = 0.1;
  const double speed = units::radPerSecFromRpm(4500.0);
  DelayFilter filter(sensor, speed, RATE, {});
  double error = 0.0, norm = 0.0;
  for (int i = 0; i < 51200; ++i) {
    const double t = i / RATE;
    double applied = 50.0, measured = 50.0;
    for (const auto& [n, amplitude] : {std::pair(4, 100.0), std::pair(16, 20.0)}) {
      const auto wave = std::polar(amplitude, n * speed * t);
      applied += wave.real();
      measured += (sensor.response(n * speed / units::TWO_PI) * wave).real();
    }
    const double estimate = filter.step(measured);
    if (t < 1.0) continue;
    error += std::pow(estimate - applied, 2);
    norm += applied * applied;
  }
  EXPECT_LT(std::sqrt(error / norm), 0.015);
}

TEST(DelayFilter, InnovationHasTheExpectedSize) {
  DelayFilter filter(ReferenceCase::exactSensor(), units::radPerSecFromRpm(9000.0), RATE, {});
  const double rms = innovationUnderNoise(filter, 51200, 25600);
  EXPECT_GT(rms, 0.98);
  EXPECT_LT(rms, 1.02 * filter.innovationStd());
}

// The targets for the Fourier form hold for this one too: 0.6 and 1.2 %, 1 % between the third and
// the eighth revolution.
TEST(DelayFilter, MeetsTheTargetsOfTheReferenceCut) {
  for (const double rpm : {9000.0, 21750.0}) {
    ReferenceCase c;
    c.spindle_speed = units::radPerSecFromRpm(rpm);
    c.duration = 0.5;
    const ReferenceRecord record = simulate(c);
    const auto sample = [&](double t) { return static_cast<std::size_t>(t * c.sample_rate); };
    const std::size_t from = sample(c.engage_time + 0.1), to = record.time.size();
    const std::size_t third = sample(c.engage_time + 2.0 * 60.0 / rpm);
    const std::size_t eighth = sample(c.engage_time + 8.0 * 60.0 / rpm);
    DelayFilter filter(c.sensor, c.spindle_speed, c.sample_rate, {});
    for (std::size_t axis = 0; axis < 2; ++axis) {
      filter.reset();
      std::vector<double> force;
      for (const double measured : record.measured[axis]) force.push_back(filter.step(measured));
      EXPECT_LT(bandError(force, record.truth[axis], RATE, from, to, 3000.0), 0.006) << rpm;
      EXPECT_LT(bandError(force, record.truth[axis], RATE, from, to, 5000.0), 0.012) << rpm;
      EXPECT_LT(bandError(force, record.truth[axis], RATE, third, eighth, 3000.0), 0.01) << rpm;
      EXPECT_LT(bandError(force, record.truth[axis], RATE, third, eighth, 5000.0), 0.01) << rpm;
    }
  }
}

// As the node's method it serves where the speed falls by 1 % under the load: the line follows the angle.
TEST(DelayFilter, FollowsASpeedThatMoves) {
  ReferenceCase c;
  c.spindle_speed = units::radPerSecFromRpm(9000.0);
  c.duration = 0.5;
  c.speed_drop = 0.01;
  const ReferenceRecord record = simulate(c);
  CompensationParameters parameters;
  parameters.delay_form = true;
  const auto force = runCompensation(c, record, c.sensor, parameters);
  for (std::size_t axis = 0; axis < 2; ++axis) {
    EXPECT_LT(bandError(force[axis], record.truth[axis], RATE, 5120, force[axis].size(), 3000.0), 0.006);
    EXPECT_LT(bandError(force[axis], record.truth[axis], RATE, 5120, force[axis].size(), 5000.0), 0.012);
  }
  parameters.track_speed = true;
  EXPECT_THROW(parameters.validate(), Error);
}

TEST(DelayFilter, RefusesAPeriodOfTooFewSamples) {
  EXPECT_THROW(DelayFilter(ReferenceCase::exactSensor(), units::TWO_PI * RATE / 10.0, RATE, {}), Error);
}

}  // namespace
}  // namespace smartmill::kalman
