#include "smartmill_sim/twin/cutting_process.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <gtest/gtest.h>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/twin/cutting_machine.h"

namespace smartmill::sim {
namespace {

using units::PI;
using units::TWO_PI;

const CuttingCoefficients ALUMINIUM{796e6, 168e6, 222e6, 27.7e3, 30.8e3, 1.4e3};

ToolGeometry endMill(int teeth, double helix_deg) {
  return {teeth, 19.05e-3, units::radFromDeg(helix_deg), {}};
}

ToolMotion motionAt(double t, double speed, double feed) {
  ToolMotion motion;
  motion.angle = 0.3 + speed * t;
  motion.speed = speed;
  motion.velocity = {{feed, 0.0}};
  motion.centre = {{0.1 + feed * t, -0.05}};
  return motion;
}

/// Largest difference of any force component over a few revolutions, as a share of the largest force.
double largestError(const ToolGeometry& tool, const Engagement& cut, double rpm, int steps_per_rev) {
  const double speed = units::radPerSecFromRpm(rpm);
  const double feed = cut.feed_per_tooth * tool.teeth * speed / TWO_PI;
  CuttingLaw law;
  law.coefficients = ALUMINIUM;
  CuttingProcess process(tool, law);
  const MechanisticForce closed(tool, ALUMINIUM, cut);
  const double dt = TWO_PI / speed / steps_per_rev;
  process.engage({{cut.entry, cut.exit, cut.axial_depth}}, motionAt(0.0, speed, feed));
  double worst = 0.0, largest = 0.0;
  for (int i = 0; i < 5 * steps_per_rev; ++i) {
    const ToolMotion motion = motionAt(i * dt, speed, feed);
    const CuttingForce f = process.step(motion), e = closed.at(motion.angle);
    worst = std::max({worst, std::abs(f.fx - e.fx), std::abs(f.fy - e.fy), std::abs(f.fz - e.fz),
                      std::abs(f.torque - e.torque) / tool.radius()});
    largest = std::max({largest, std::abs(e.fx), std::abs(e.fy)});
  }
  return worst / largest;
}

// Steady cutting with a rigid even tool has a closed form (eq. 3.13..3.15 integrated along the helix).
TEST(CuttingProcess, rigidSteadyCutMatchesTheClosedForm) {
  EXPECT_LT(largestError(endMill(4, 30.0), {0.0, PI, 2e-3, 6e-5}, 4500.0, 2731), 5e-4);
  EXPECT_LT(largestError(endMill(4, 30.0), {0.0, 0.5 * PI, 4e-3, 8e-5}, 4500.0, 2731), 5e-4);
  EXPECT_LT(largestError(endMill(4, 30.0), {0.5 * PI, PI, 4e-3, 8e-5}, 13950.0, 881), 5e-4);
  EXPECT_LT(largestError(endMill(1, 45.0), {1.2, 1.3, 10e-3, 5e-5}, 600.0, 9973), 1e-3);
  EXPECT_LT(largestError(endMill(2, 0.0), {0.4, 2.2, 3e-3, 1e-4}, 6000.0, 2001), 5e-4);
  // Many steps from node to node of the surface.
  EXPECT_LT(largestError(endMill(4, 30.0), {0.0, PI, 2e-3, 6e-5}, 1200.0, 10240), 5e-4);
}

/// Growth of the vibration of a tool with one mode: size over the last quarter of a cut over that over the
/// second quarter.
double growth(double depth, double rpm, bool both_axes, int steps_per_rev, Feed steadiness = Feed::any) {
  // Insperger's benchmark: m 0.03993 kg, 922 Hz, damping ratio 0.011, 2 teeth, Kt 6e8, Kn 2e8 N/m2.
  MachineModel model;
  model.tool = endMill(2, 0.0);
  model.cutting = CuttingCoefficients{6e8, 2e8, 0.0, 0.0, 0.0, 0.0};
  const Mode mode{922.0, 0.011, 1.0 / (0.03993 * std::pow(TWO_PI * 922.0, 2))};
  model.tool_tip.x.modes = {mode};
  if (both_axes) model.tool_tip.y.modes = {mode};
  const double speed = units::radPerSecFromRpm(rpm), dt = TWO_PI / speed / steps_per_rev;
  CuttingMachine machine(model, dt, steadiness);
  const double feed = 2e-4 * 2.0 * speed / TWO_PI;  // large: the tool must not leave the cut
  CuttingMachine::Input input;
  input.motion = motionAt(0.0, speed, feed);
  machine.engage({{0.0, PI, depth}}, input.motion);
  const int revolutions = 240;
  std::vector<double> x;
  for (int i = 0; i < revolutions * steps_per_rev; ++i) {
    input.motion = motionAt(i * dt, speed, feed);
    // A push in the first revolution.
    input.tip_force[0] = i < steps_per_rev / 8 ? 1.0 : 0.0;
    x.push_back(machine.step(input).displacement[0]);
  }
  // What does not repeat from revolution to revolution is the vibration that grows or dies.
  const auto size = [&](int from, int to) {
    double sum = 0.0;
    for (int i = from * steps_per_rev; i < to * steps_per_rev; ++i) {
      const auto k = static_cast<std::size_t>(i);
      sum += std::pow(x[k] - x[k - static_cast<std::size_t>(steps_per_rev)], 2);
    }
    return std::sqrt(sum);
  };
  return size(3 * revolutions / 4, revolutions) / size(revolutions / 4, revolutions / 2);
}

// First limits of the oracle (converged Chebyshev collocation; see the stability oracles): slot, one mode in
// x.
TEST(CuttingMachine, chattersAboveTheStabilityLimitOnly) {
  struct Case {
    double rpm, limit;
  };
  for (const Case c : {Case{10000.0, 0.32238e-3}, Case{5000.0, 0.40863e-3}, Case{15000.0, 0.38659e-3}}) {
    EXPECT_LT(growth(0.97 * c.limit, c.rpm, false, 1200), 1.0) << c.rpm;
    EXPECT_GT(growth(1.03 * c.limit, c.rpm, false, 1200), 1.0) << c.rpm;
  }
}

// The same mode in x and y, slot: 0.0714108 mm at 10000 rpm, 0.0483482 mm at 6000 rpm.
TEST(CuttingMachine, chattersAboveTheLimitOfTwoAxes) {
  EXPECT_LT(growth(0.97 * 0.0714108e-3, 10000.0, true, 1200), 1.0);
  EXPECT_GT(growth(1.03 * 0.0714108e-3, 10000.0, true, 1200), 1.0);
  EXPECT_LT(growth(0.97 * 0.0483482e-3, 6000.0, true, 2000), 1.0);
  EXPECT_GT(growth(1.03 * 0.0483482e-3, 6000.0, true, 2000), 1.0);
}

TEST(CuttingMachine, steadyFeedChattersAtTheSameLimits) {
  for (const auto& [rpm, limit] : {std::pair(10000.0, 0.32238e-3), std::pair(5000.0, 0.40863e-3)}) {
    EXPECT_LT(growth(0.98 * limit, rpm, false, 1200, Feed::steady), 1.0) << rpm;
    EXPECT_GT(growth(1.02 * limit, rpm, false, 1200, Feed::steady), 1.0) << rpm;
  }
  EXPECT_LT(growth(0.98 * 0.0483482e-3, 6000.0, true, 2000, Feed::steady), 1.0);
  EXPECT_GT(growth(1.02 * 0.0483482e-3, 6000.0, true, 2000, Feed::steady), 1.0);
}

TEST(CuttingProcess, runoutLetsOneToothOfTwoDoAllTheWork) {
  // Offset over half the feed: tooth 1 takes the chip of both, tooth 2 never touches.
  CuttingLaw law;
  law.coefficients = {1e9, 0.0, 0.0, 0.0, 0.0, 0.0};
  const double f = 5e-5, speed = 500.0, feed = f * 2.0 * speed / TWO_PI, depth = 1e-3;
  CuttingProcess process(endMill(2, 0.0), law, {30e-6, -30e-6});
  const double dt = TWO_PI / speed / 1000.0;
  process.engage({{0.0, PI, depth}}, motionAt(0.0, speed, feed));
  double first = 0.0, second = 0.0;
  for (int i = 0; i < 5000; ++i) {
    const ToolMotion motion = motionAt(i * dt, speed, feed);
    const CuttingForce force = process.step(motion);
    const double angle = std::fmod(motion.angle, TWO_PI);
    double& peak = angle < PI ? first : second;
    peak = std::max(peak, force.torque);
  }
  EXPECT_NEAR(first, 1e9 * 2.0 * f * depth * 0.5 * 19.05e-3, 0.01 * first);
  EXPECT_EQ(second, 0.0);
}

TEST(CuttingProcess, refusesContactThatCannotBe) {
  CuttingLaw law;
  CuttingProcess process(endMill(2, 0.0), law);
  EXPECT_THROW(process.engage({{0.5, 0.5, 1e-3}}, {}), Error);
  EXPECT_THROW(process.engage({{0.0, 7.0, 1e-3}}, {}), Error);
  EXPECT_THROW(process.engage({{0.0, 1.0, 0.0}}, {}), Error);
  EXPECT_THROW(CuttingProcess(endMill(2, 0.0), law, {1e-6}), Error);
}

}  // namespace
}  // namespace smartmill::sim
