#include "smartmill_sim/world/motor_currents.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

Spindle spindle() {
  Spindle s;
  s.viscous = 2e-3;
  s.coulomb = 0.4;
  return s;
}

MotorTraits quiet() {
  MotorTraits t;
  t.currents = true;
  t.noise = t.harmonic = t.warm_up = 0.0;
  t.disturbance = {0.0, 0.0, 0.0};
  return t;
}

/// Runs at constant velocity under constant forces. @return samples by channel [A]
std::array<std::vector<double>, 4> run(MotorCurrents& motors, const std::array<double, 3>& velocity,
                                       const std::array<double, 3>& force, double torque, double speed,
                                       double duration = 3.0) {
  constexpr double RATE = 25600.0;
  std::array<std::vector<double>, 4> currents;
  const auto steps = static_cast<int>(duration * RATE);
  for (int i = 0; i < steps; ++i) {
    MotorCurrents::Input input;
    input.time = i / RATE;
    for (std::size_t a = 0; a < 3; ++a) {
      input.motion.position[a] = velocity[a] * input.time;
      input.motion.velocity[a] = velocity[a];
    }
    input.motion.spindle_speed = speed;
    input.motion.spindle_angle = std::fmod(speed * input.time, units::TWO_PI);
    input.force = force;
    input.torque = torque;
    motors.push(input);
  }
  const SampleBlock block = motors.take();
  for (std::size_t i = block.size() / 3; i < block.size(); ++i)
    for (std::size_t c = 0; c < 4; ++c) currents[c].push_back(block.at(i, c));
  return currents;
}

double rangeOf(const std::vector<double>& samples) {
  double squares = 0.0, mean = 0.0;
  for (const double s : samples) mean += s / static_cast<double>(samples.size());
  for (const double s : samples) squares += (s - mean) * (s - mean) / static_cast<double>(samples.size());
  return 2.0 * std::sqrt(2.0 * squares);  // of a sine over many periods
}

// Cheng & Venuvinod eq. 2 and 3: the range is proportional to weight, friction and the cutting force against
// the motion.
TEST(MotorCurrents, rangeIsTheLoadOfTheDrive) {
  MotorTraits traits = quiet();
  traits.weight = {0.0, 300.0, 0.0};
  const double v = 20e-3;
  MotorCurrents air(traits, spindle(), 1), cut(traits, spindle(), 1);
  const auto in_air = run(air, {v, v, 0.0}, {0, 0, 0}, 0.0, 200.0);
  const auto in_cut = run(cut, {v, v, 0.0}, {-250.0, -100.0, 80.0}, 0.0, 200.0);
  const double friction = 150.0 + 600.0 * v;  // the Stribeck term is negligible at ten times its velocity
  EXPECT_NEAR(rangeOf(in_air[0]) * 200.0, friction, 2.0);
  EXPECT_NEAR(rangeOf(in_air[1]) * 200.0, friction + 300.0, 5.0);
  EXPECT_NEAR((rangeOf(in_cut[0]) - rangeOf(in_air[0])) * 200.0, 250.0, 3.0);
  EXPECT_NEAR((rangeOf(in_cut[1]) - rangeOf(in_air[1])) * 200.0, 100.0, 5.0);
  // At rest there is no current range (section 5).
  EXPECT_NEAR(rangeOf(in_cut[2]), 0.0, 1e-9);
}

TEST(MotorCurrents, slowSlidesHaveMoreFriction) {
  const MotorTraits traits = quiet();
  const auto at = [&](double v) {
    MotorCurrents motors(traits, spindle(), 1);
    return rangeOf(run(motors, {v, 0.0, 0.0}, {0, 0, 0}, 0.0, 200.0, 12.0)[0]) * 200.0;
  };
  const double slow = at(2e-3), quick = at(16e-3);
  EXPECT_NEAR(slow, 150.0 + 60.0 / std::exp(1.0) + 600.0 * 2e-3, 3.0);
  EXPECT_NEAR(quick, 150.0 + 600.0 * 16e-3, 3.0);
}

// Below base speed the torque per ampere is constant; above it both currents change with the speed (constant
// power).
TEST(MotorCurrents, spindleIsMagnetisedAndWeakensItsField) {
  const MotorTraits traits = quiet();
  const MotorCurrents motors(traits, spindle(), 1);
  EXPECT_NEAR(motors.spindleRange(0.0, 100.0), 6.0, 1e-12);
  EXPECT_NEAR(motors.spindleRange(9.6, 100.0), std::hypot(6.0, 8.0), 1e-12);
  EXPECT_NEAR(motors.spindleRange(9.6, 330.0), std::hypot(3.0, 16.0), 1e-12);
  MotorCurrents turning(traits, spindle(), 1);
  const auto currents = run(turning, {0, 0, 0}, {0, 0, 0}, 9.0, 100.0);
  EXPECT_NEAR(rangeOf(currents[3]), motors.spindleRange(9.0 + 0.4 + 0.2, 100.0), 0.05);
}

// Broms: temperature changes the constants. 20 K more: 16 % less friction, 2.2 % less force per ampere.
TEST(MotorCurrents, temperatureChangesFrictionAndConstants) {
  MotorTraits warm = quiet();
  warm.temperature = 40.0;
  MotorCurrents motors(warm, spindle(), 1);
  const double v = 20e-3;
  const auto currents = run(motors, {v, 0, 0}, {0, 0, 0}, 0.0, 100.0);
  EXPECT_NEAR(rangeOf(currents[0]) * 200.0, 0.84 * (150.0 + 600.0 * v) / 0.978, 2.0);
  MotorTraits warming = quiet();
  warming.warm_up = 0.05;
  warming.warm_up_time = 1.0;
  MotorCurrents busy(warming, spindle(), 1);
  run(busy, {0, 0, 0}, {0, 0, 0}, 0.0, 500.0, 8.0);
  // Friction power: (1.0 + 0.4) N m x 500 rad/s, reduced by its own warming: T = 20 + 0.05 P (1 - 0.008 (T -
  // 20)).
  const double power = (2e-3 * 500.0 + 0.4) * 500.0;
  const double rise = 0.05 * power / (1.0 + 0.05 * power * 0.008);
  EXPECT_NEAR(busy.temperature(), 20.0 + rise, 0.05 * rise);
}

TEST(MotorCurrents, samplesAreAtOneKilohertz) {
  MotorCurrents motors(quiet(), spindle(), 1);
  MotorCurrents::Input input;
  std::uint64_t next = 0;
  for (int k = 0; k < 100; ++k) {
    for (int i = 0; i < 256; ++i) {
      input.time = (k * 256 + i) / 25600.0;
      motors.push(input);
    }
    const SampleBlock block = motors.take();
    ASSERT_EQ(block.first_index, next);
    ASSERT_NEAR(block.stamp * 1000.0, static_cast<double>(next), 1e-6);
    next += block.size();
  }
  EXPECT_EQ(next, 1000u);
}

}  // namespace
}  // namespace smartmill::sim
