// Forces and torques of the closed-form mechanics (mechanistic.h) through a load meter with lag and friction.
#include "smartmill_kalman/sensor/torque_check.h"

#include <cmath>
#include <cstdint>
#include <functional>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/frames.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

constexpr double RATE = 10240.0;   // [Hz]
constexpr std::size_t SIZE = 128;  // [samples] of a block
constexpr double CUT = 2.0;        // [s] on the steady path
constexpr double FAULT = 1.0;      // [s] after its beginning
constexpr double PROMPT = 0.5;     // [s] time in which a fault is to be announced
constexpr std::array<double, 9> ALIGNED{{1, 0, 0, 0, 1, 0, 0, 0, 1}};
constexpr std::array<double, 9> TURNED{{0, -1, 0, 1, 0, 0, 0, 0, 1}};  // sensor x is machine y

Spindle nominalSpindle() {
  Spindle spindle;
  spindle.viscous = 3.7e-4;
  spindle.coulomb = 0.1;
  spindle.load_meter_gain = 3.88e-4;
  spindle.load_meter_bandwidth = 7.0;
  spindle.load_meter_full_scale = 8.0;
  return spindle;
}

struct Case {
  double rpm = 4000.0, entry = 0.0, exit = units::PI, depth = 2e-3, feed = 1e-4;
  double heading = 0.0;  // [rad] in the machine's frame
  std::array<double, 9> rotation = ALIGNED;
  CuttingCoefficients coefficients{900e6, 300e6, 100e6, 25e3, 25e3, 5e3};  // al7050
  double friction = 1.3;  // [1] of the nominal one, which the air cut shows
  bool air = true;
  double load_period = 0.02;  // [s]
};

struct Outcome {
  double announced = NOT_A_NUMBER;  // [s] after the fault
  std::string line;
  bool disagrees_at_end = false;
  double ratio = 0.0;
};

using Distort = std::function<void(std::array<double, 3>&)>;

/// An air cut, then a cut whose sensor has the fault from FAULT to `until` after its beginning.
Outcome run(const Case& c, const Distort& distort = {}, double until = 1e9) {
  const Spindle spindle = nominalSpindle();
  TorqueCheck check(spindle);
  check.setRotation(c.rotation);
  CuttingCondition condition;
  condition.kind = CuttingCondition::Kind::air;
  condition.tool = {4, 19.05e-3, units::radFromDeg(30.0), {}};
  condition.engagement = {c.entry, c.exit, c.depth, c.feed};
  condition.spindle_speed = units::radPerSecFromRpm(c.rpm);
  const double speed = condition.spindle_speed, velocity = 4 * c.feed * speed / units::TWO_PI,
               cos = std::cos(c.heading), sin = std::sin(c.heading);
  condition.steady_to = {cos * velocity * CUT, sin * velocity * CUT, 0.0};
  const MechanisticForce mechanics(condition.tool, c.coefficients, condition.engagement);
  const double idle = c.friction * spindle.friction().at(speed), cutting = mechanics.mean().torque;
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 1.0);  // [N]
  Outcome outcome;
  double load = idle, next_load = 0.0, cut_since = 1.0;
  if (c.air) check.handle(condition);
  for (std::uint64_t block = 0; block * SIZE < static_cast<std::uint64_t>((cut_since + CUT) * RATE);
       ++block) {
    const double stamp = static_cast<double>(block * SIZE) / RATE;
    const bool cuts = stamp >= cut_since;
    if (cuts && condition.kind != CuttingCondition::Kind::cut) {
      condition.kind = CuttingCondition::Kind::cut;
      check.handle(condition);
    }
    const double torque = idle + (cuts ? cutting : 0.0),
                 lag = 1.0 / (units::TWO_PI * spindle.load_meter_bandwidth);
    load += (torque - load) * (1.0 - std::exp(-static_cast<double>(SIZE) / RATE / lag));
    if (stamp >= next_load) {
      next_load += c.load_period;
      CncState state;
      state.stamp = stamp;
      state.connected = state.motion = true;
      state.axes = {"X", "Y", "Z"};
      const double along = velocity * (stamp - cut_since);
      state.position = {cos * along, sin * along, 0.0};
      check.handle(state);
      check.handle(LoadSample{
          stamp, load * speed * spindle.load_meter_gain / *spindle.load_meter_full_scale, speed, {}, {}});
    }
    ForceBlock measured;
    measured.stamp = stamp;
    measured.sample_rate = RATE;
    for (std::size_t i = 0; i < SIZE; ++i) {
      const double time = stamp + static_cast<double>(i) / RATE;
      const CuttingForce f = cuts ? mechanics.at(speed * time) : CuttingForce{};
      const std::array<double, 3> machine{{cos * f.fx - sin * f.fy, sin * f.fx + cos * f.fy, f.fz}};
      std::array<double, 3> sensor{{0, 0, 0}};
      for (std::size_t row = 0; row < 3; ++row)
        for (std::size_t column = 0; column < 3; ++column)
          sensor[column] += c.rotation[3 * row + column] * machine[row];
      for (double& value : sensor) value += noise(random);
      const double since = time - cut_since;
      if (distort && since >= FAULT && since < until) distort(sensor);
      for (std::size_t axis = 0; axis < 3; ++axis) measured.force[axis].push_back(sensor[axis]);
    }
    check.handle(measured, {{0.0, 0.0, 0.0}});
    const std::string line = check.takeLine();
    if (!line.empty() && outcome.line.empty()) {
      outcome.line = line;
      outcome.announced = stamp + SIZE / RATE - cut_since - FAULT;
    }
  }
  outcome.disagrees_at_end = check.disagrees();
  outcome.ratio = check.ratio();
  return outcome;
}

TEST(TorqueCheck, SoundCutsAgree) {
  for (const double rpm : {600.0, 1500.0, 4000.0, 12000.0}) {
    for (const auto& [entry, exit] : std::vector<std::pair<double, double>>{{0.0, units::PI},
                                                                            {0.0, 0.5 * units::PI},
                                                                            {0.5 * units::PI, units::PI},
                                                                            {0.0, 0.7},
                                                                            {2.4, units::PI},
                                                                            {1.0, 2.5}}) {
      for (const double feed : {2e-5, 1e-4, 3e-4}) {
        for (const auto& material :
             {CuttingCoefficients{900e6, 300e6, 100e6, 25e3, 25e3, 5e3},      // aluminium
              CuttingCoefficients{2200e6, 1100e6, 400e6, 40e3, 60e3, 10e3},   // steel
              CuttingCoefficients{1900e6, 480e6, 600e6, 24e3, 43e3, 3e3}}) {  // titanium
          Case c;
          c.rpm = rpm;
          c.entry = entry;
          c.exit = exit;
          c.feed = feed;
          c.coefficients = material;
          c.heading = rpm / 1000.0;
          const Outcome outcome = run(c);
          EXPECT_EQ(outcome.line, "") << rpm << " " << entry << " " << exit << " " << feed;
        }
      }
    }
  }
}

// A slot whose edges only rub has the lowest ratio, 8 / pi^2 (mean over the half circle of sin^2 and of 1).
TEST(TorqueCheck, EdgeForcesLowerTheRatio) {
  Case c;
  c.coefficients = {1e6, 0.0, 0.0, 100e3, 0.0, 0.0};
  EXPECT_NEAR(run(c).ratio, 8.0 / (units::PI * units::PI), 0.01);
  c.coefficients = {900e6, 300e6, 0.0, 0.0, 0.0, 0.0};
  EXPECT_NEAR(run(c).ratio, 1.0, 0.01);
}

TEST(TorqueCheck, WrongChannelsAreAnnounced) {
  const std::vector<std::pair<Distort, std::string>> faults{
      {[](auto& f) {
         for (double& v : f) v *= 1.5;
       },
       "wrong scale of the forces or of the load meter"},
      {[](auto& f) {
         for (double& v : f) v *= 0.5;
       },
       "wrong scale of the forces or of the load meter"},
      {[](auto& f) {
         for (double& v : f) v = -v;
       },
       "wrong sign"},
      {[](auto& f) { std::swap(f[0], f[1]); }, "channels exchanged"},
      {[](auto& f) { f[0] = -f[0]; }, "wrong sign of fx"},
      {[](auto& f) { f[1] = -f[1]; }, "wrong sign of fy"}};
  for (const auto& rotation : {ALIGNED, TURNED}) {
    for (const double heading : {0.0, 0.5 * units::PI, units::PI}) {
      for (const auto& [distort, explanation] : faults) {
        Case c;
        c.rotation = rotation;
        c.heading = heading;
        c.load_period = 0.08;  // of a slow connection
        const Outcome outcome = run(c, distort);
        EXPECT_LE(outcome.announced, PROMPT) << explanation;
        EXPECT_NE(outcome.line.find("load meter measures"), std::string::npos);
        EXPECT_NE(outcome.line.find(": " + explanation + " at"), std::string::npos) << outcome.line;
        EXPECT_TRUE(outcome.disagrees_at_end);
        EXPECT_FALSE(run(c, distort, FAULT + 0.4).disagrees_at_end) << explanation;
      }
    }
  }
}

// Friction of a spindle that has not turned in air is that of the model.
TEST(TorqueCheck, WithoutAnAirCutTheFrictionOfTheModelIsUsed) {
  Case c;
  c.air = false;
  for (const double friction : {0.5, 1.0, 1.7}) {
    c.friction = friction;
    EXPECT_EQ(run(c).line, "") << friction;
  }
}

TEST(TorqueCheck, NeedsTheFullScale) {
  Spindle spindle = nominalSpindle();
  spindle.load_meter_full_scale.reset();
  EXPECT_THROW(TorqueCheck{spindle}, Error);
}

}  // namespace
}  // namespace smartmill::kalman
