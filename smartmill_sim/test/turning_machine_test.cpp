#include "smartmill_sim/turning/turning_machine.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

constexpr double SPEED = 57.5, STIFFNESS = 7e5, EXPONENT = 0.45, CHIP = 1e-4;  // [rad/s], [N/m], [1], [m]
constexpr double VISCOUS = 5e-3, COULOMB = 0.6, GAIN = 7e-4, FULL_SCALE = 8.0;

Spindle spindle() {
  Spindle s;
  s.viscous = VISCOUS;
  s.coulomb = COULOMB;
  s.load_meter_gain = GAIN;
  s.load_meter_bandwidth = 7.0;
  s.load_meter_full_scale = FULL_SCALE;
  return s;
}

LatheTraits stableCut() {
  LatheTraits traits;
  traits.spindle_speed = SPEED;
  traits.cutting_stiffness = STIFFNESS;
  traits.chip_exponent = EXPONENT;
  return traits;
}

/// One pass without noise, ripple and warm-up.
TurningTraits quietPass(double angle, double feed, double depth) {
  TurningTraits traits;
  traits.passes.angle = {angle};
  traits.passes.feed = {feed};
  traits.passes.depth = {depth};
  traits.passes.duration = 6.0;
  traits.motor.currents = true;
  traits.motor.noise = traits.motor.harmonic = traits.motor.warm_up = 0.0;
  traits.motor.disturbance = {0.0, 0.0, 0.0};
  return traits;
}

/// Range of a phase current whose electrical angle is known, with the sign of the load.
struct SignedRange {
  double product = 0.0, squares = 0.0;
  void add(double current, double periods) {
    const double s = std::sin(units::TWO_PI * periods);
    product += current * s, squares += s * s;
  }
  double value() const { return 2.0 * product / squares; }
};

/// Means over the second half of a feed.
struct PassResult {
  std::array<SignedRange, 3> range;
  double spindle_low = 1e9, spindle_high = -1e9;  // [A] extremes of the phase current
  double load = 0.0, radius = 0.0;                // [1] at the end, [m] at the end
  std::array<double, 3> force{};                  // [N] at the end
};

/// Air pass and cut of one pass.
std::array<PassResult, 2> run(const TurningTraits& traits) {
  Lathe lathe(stableCut());
  TurningMachine machine(lathe, traits, stableCut(), spindle());
  TurningPasses twin(traits.passes, SPEED);
  std::array<PassResult, 2> results;
  constexpr std::size_t SIZE = 50;
  for (double begin = 0.0; begin < 20.0; begin += SIZE / 1e4) {
    const TurningMachine::Block block = machine.advance(SIZE);
    twin.advance(begin);
    const auto kind = twin.condition().kind;
    const double in_feed = begin - twin.condition().stamp;
    if (kind == CuttingCondition::Kind::none || in_feed < 3.0 || in_feed > 6.3) continue;
    PassResult& result = results[kind == CuttingCondition::Kind::cut ? 1 : 0];
    for (std::size_t i = 0; i < block.motor_current.size(); ++i) {
      const auto position = twin.state(block.motor_current.timeOf(i)).position;
      for (std::size_t a = 0; a < 3; ++a)
        result.range[a].add(block.motor_current.at(i, a), traits.motor.phase_per_metre[a] * position[a]);
      result.spindle_low = std::min(result.spindle_low, block.motor_current.at(i, 3));
      result.spindle_high = std::max(result.spindle_high, block.motor_current.at(i, 3));
    }
    result.load = block.load.spindle_load;
    result.radius = twin.radius(block.load.stamp);
    for (std::size_t a = 0; a < 3; ++a) result.force[a] = block.force.force[a].back();
  }
  return results;
}

/// With full overlap the steady chip is the feed, whatever the deflection.
double feedForce(double feed, double width) {
  return width * STIFFNESS * CHIP / EXPONENT * std::pow(feed / CHIP, EXPONENT);
}

// Against the feed, along the cutting speed, away from the workpiece.
TEST(TurningForces, pointAgainstFeedAndAwayFromTheWorkpiece) {
  TurningForces forces;
  forces.tangential_ratio = 1.5;
  forces.radial_ratio = 0.4;
  const auto longitudinal = forces.onTool(100.0, 0.0);
  EXPECT_NEAR(longitudinal[0], 40.0, 1e-9);
  EXPECT_NEAR(longitudinal[1], 150.0, 1e-9);
  EXPECT_NEAR(longitudinal[2], 100.0, 1e-9);
  const auto facing = forces.onTool(100.0, 0.5 * units::PI);
  EXPECT_NEAR(facing[0], 100.0, 1e-9);
  EXPECT_NEAR(facing[2], 40.0, 1e-9);
  const auto taper = forces.onTool(100.0, 0.25 * units::PI);
  EXPECT_NEAR(taper[0], 140.0 / std::sqrt(2.0), 1e-9);
  EXPECT_NEAR(taper[2], 60.0 / std::sqrt(2.0), 1e-9);
}

// A screw of lead l turns a force F into a torque F l / (2 pi), a motor with K N m/A into a current F l / (2
// pi K): the Z drive with a lead of 5 mm and 0.1718 N m/A. X at rest carries the passive force by its dry
// friction and the motor the excess of the weight over it.
TEST(TurningMachine, feedForceLoadsTheMotorOfZ) {
  const double feed = 2e-4, width = 0.8, v = feed * SPEED / units::TWO_PI, force = feedForce(feed, width);
  const auto [air, cut] = run(quietPass(0.0, feed, width * 1e-3));
  EXPECT_NEAR(cut.force[2], force, 0.005 * force);
  EXPECT_NEAR(cut.force[1], 1.491 * force, 0.005 * 1.491 * force);
  EXPECT_NEAR(cut.force[0], 0.5 * force, 0.005 * 0.5 * force);
  EXPECT_EQ(air.force[2], 0.0);
  const double friction = 150.0 + 60.0 * std::exp(-std::pow(v / 2e-3, 2)) + 600.0 * v;
  constexpr double LEAD = 0.005, TORQUE_PER_AMPERE = 0.17181;         // [m], [N m/A]
  const double amperes = LEAD / (units::TWO_PI * TORQUE_PER_AMPERE);  // per newton
  // Towards -Z the motor pushes in the negative direction.
  EXPECT_NEAR(air.range[2].value(), -friction * amperes, 0.01);
  EXPECT_NEAR(cut.range[2].value(), -(friction + force) * amperes, 0.01);
}

// The weight aids the infeed: the current falls with the force (Cheng & Venuvinod, section 9, ii).
TEST(TurningMachine, infeedForceUnloadsTheMotorOfX) {
  const double feed = 1.5e-4, width = 0.6, v = feed * SPEED / units::TWO_PI, force = feedForce(feed, width);
  const auto [air, cut] = run(quietPass(0.5 * units::PI, feed, width * 1e-3));
  EXPECT_NEAR(cut.force[0], force, 0.005 * force);
  const double without = 318.0 - 60.0 - 600.0 * v;
  EXPECT_NEAR(air.range[0].value(), without / 198.45, 0.01);
  EXPECT_NEAR(cut.range[0].value(), (without - force) / 198.45, 0.01);
}

// Torque T = Ft (r + ap / 2), friction viscous and dry; magnetising current in quadrature; power on the load
// meter.
TEST(TurningMachine, tangentialForceLoadsTheSpindle) {
  const double feed = 2e-4, width = 0.8,
               torque = 1.491 * feedForce(feed, width) * (0.03 - 0.5 * width * 1e-3);
  const double friction = COULOMB + VISCOUS * SPEED;
  const auto [air, cut] = run(quietPass(0.0, feed, width * 1e-3));
  EXPECT_NEAR(cut.radius, 0.03 - 0.5 * width * 1e-3, 1e-9);
  EXPECT_NEAR(air.spindle_high - air.spindle_low, std::hypot(6.0, friction / 1.2), 0.02);
  EXPECT_NEAR(cut.spindle_high - cut.spindle_low, std::hypot(6.0, (torque + friction) / 1.2), 0.05);
  EXPECT_NEAR(air.load, GAIN * friction * SPEED / FULL_SCALE, 1e-6);
  EXPECT_NEAR(cut.load, GAIN * (torque + friction) * SPEED / FULL_SCALE, 0.005 * cut.load);
}

// Facing: constant force, the torque falls with the radius.
TEST(TurningMachine, torqueFallsWithTheRadiusInFacing) {
  const auto [air, cut] = run(quietPass(0.5 * units::PI, 1.5e-4, 0.6e-3));
  EXPECT_LT(cut.radius, 0.025);
  const double power = cut.load * FULL_SCALE / GAIN, friction = COULOMB + VISCOUS * SPEED;
  // The load meter lags by 23 ms, in which the radius falls by 0.03 mm.
  EXPECT_NEAR(power / SPEED - friction, cut.force[1] * cut.radius, 0.01 * cut.force[1] * cut.radius);
}

// Inertia: the motor of a slide accelerates its mass, friction and weight in addition.
TEST(TurningMachine, accelerationLoadsTheMotor) {
  const AxisDrive drive = [] {
    MotorTraits motors = TurningTraits::turningMotors();
    motors.currents = true;
    motors.disturbance = {0.0, 0.0, 0.0};
    return motors.drives()[0];
  }();
  EXPECT_NEAR(drive.force(0.0, 0.05, 1.0, 0.0), 400.0 * 1.0 + 60.0 + 600.0 * 0.05 + 318.0, 1e-9);
  EXPECT_NEAR(drive.force(0.0, -0.05, -1.0, 100.0), -400.0 - 60.0 - 600.0 * 0.05 + 318.0 - 100.0, 1e-9);
}

TEST(TurningPasses, eachPassIsDoneInAirAndInTheCut) {
  PassTraits traits;
  traits.duration = 2.0;
  TurningPasses passes(traits, SPEED);
  std::vector<CuttingCondition> conditions{passes.condition()};
  double cutting = 0.0;
  for (double t = 0.0; conditions.size() < 18; t += 0.005) {
    if (passes.advance(t)) conditions.push_back(passes.condition());
    const CuttingCondition& c = passes.condition();
    const auto at = passes.state(t);
    if (passes.isCutting(t)) {
      cutting += 0.005;
      ASSERT_EQ(c.kind, CuttingCondition::Kind::cut);
      for (std::size_t a = 0; a < 3; ++a)
        ASSERT_LE((at.position[a] - c.steady_from[a]) * (at.position[a] - c.steady_to[a]), 1e-9);
    }
  }
  EXPECT_NEAR(cutting, 4 * 2.0, 0.1);
  for (std::size_t i = 0; i + 1 < 16; ++i) {
    const std::array<CuttingCondition::Kind, 4> order{
        CuttingCondition::Kind::none, CuttingCondition::Kind::air, CuttingCondition::Kind::none,
        CuttingCondition::Kind::cut};
    EXPECT_EQ(conditions[i].kind, order[i % 4]) << i;
  }
  // Air pass and cut have the same way; the cut is 2 mm nearer to the axis or to the face.
  for (std::size_t pass = 0; pass < 4; ++pass) {
    const CuttingCondition &air = conditions[4 * pass + 1], &cut = conditions[4 * pass + 3];
    for (std::size_t a = 0; a < 3; ++a) {
      EXPECT_NEAR(air.steady_to[a] - air.steady_from[a], cut.steady_to[a] - cut.steady_from[a], 1e-9);
      EXPECT_NEAR(air.steady_from[a] - cut.steady_from[a], 2e-3 * clearDirection(traits.angle[pass])[a],
                  1e-9);
    }
    EXPECT_EQ(cut.tool.teeth, 0);
    EXPECT_EQ(cut.engagement.feed_per_tooth, traits.feed[pass]);
    EXPECT_EQ(cut.engagement.axial_depth, traits.depth[pass]);
  }
  // The first pass is longitudinal: the radius at half depth.
  EXPECT_NEAR(conditions[3].tool.diameter, 2.0 * (0.03 - 0.5e-3), 1e-9);
}

TEST(TurningPasses, refusesListsOfDifferentLengthAndPassesBeyondTheAxis) {
  PassTraits traits;
  traits.feed.pop_back();
  EXPECT_THROW(TurningPasses(traits, SPEED), Error);
  traits = PassTraits();
  traits.duration = 60.0;
  EXPECT_THROW(TurningPasses(traits, SPEED), Error);
}

}  // namespace
}  // namespace smartmill::sim
