#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/twin/cutting_machine.h"
#include "smartmill_sim/twin/regenerative_cut.h"
#include "smartmill_sim/twin/rigid_cut.h"

namespace smartmill::sim {
namespace {

using units::PI;
using units::TWO_PI;

const CuttingCoefficients ALUMINIUM{796e6, 168e6, 222e6, 27.7e3, 30.8e3, 1.4e3};

struct Setting {
  ToolGeometry tool;
  Engagement cut;
};

std::vector<Setting> settings() {
  const auto mill = [](int teeth, double helix_deg, std::vector<double> pitch = {}) {
    return ToolGeometry{teeth, 19.05e-3, units::radFromDeg(helix_deg), std::move(pitch)};
  };
  const double right = 0.5 * PI;
  return {{mill(4, 30.0), {0.0, PI, 2e-3, 6e-5}},
          {mill(4, 30.0), {0.0, 0.5 * PI, 4e-3, 8e-5}},
          {mill(4, 30.0), {0.5 * PI, PI, 4e-3, 8e-5}},
          {mill(1, 45.0), {1.2, 1.3, 10e-3, 5e-5}},
          {mill(2, 0.0), {0.4, 2.2, 3e-3, 1e-4}},
          {mill(4, 45.0), {0.0, PI, 70e-3, 5e-5}},  // the edge lags by more than a turn
          {mill(4, 30.0, {right - 0.05, right + 0.05, right - 0.05, right + 0.05}), {0.0, PI, 2e-3, 6e-5}}};
}

ToolMotion motionOf(const Setting& s, double speed) {
  ToolMotion motion;
  motion.speed = speed;
  motion.velocity[0] = s.cut.feed_per_tooth * s.tool.teeth * speed / TWO_PI;
  return motion;
}

double largestDifference(const CuttingForce& a, const CuttingForce& b, double radius) {
  return std::max({std::abs(a.fx - b.fx), std::abs(a.fy - b.fy), std::abs(a.fz - b.fz),
                   std::abs(a.torque - b.torque) / radius});
}

// Without vibration both are the closed form of eq. 3.13..3.15; steps between the nodes of any table.
TEST(SteadyCut, rigidForcesAreTheClosedForm) {
  for (const Setting& s : settings()) {
    const double speed = 500.0, dt = TWO_PI / speed / 1777.0;
    CuttingLaw law;
    law.coefficients = ALUMINIUM;
    const MechanisticForce closed(s.tool, ALUMINIUM, s.cut);
    RigidCut rigid(s.tool, law);
    RegenerativeCut regenerative(s.tool, law, dt);
    const std::vector<ContactArc> arcs{{s.cut.entry, s.cut.exit, s.cut.axial_depth}};
    rigid.engage(arcs, motionOf(s, speed));
    regenerative.engage(arcs, motionOf(s, speed));
    double largest = 0.0, of_rigid = 0.0, of_regenerative = 0.0;
    for (int i = 0; i < 1777; ++i) {
      const double angle = -3.0 + TWO_PI * i / 1777.0;
      const CuttingForce exact = closed.at(angle);
      largest = std::max({largest, std::abs(exact.fx), std::abs(exact.fy)});
      of_rigid = std::max(of_rigid, largestDifference(rigid.at(angle), exact, s.tool.radius()));
      of_regenerative = std::max(of_regenerative,
                                 largestDifference(regenerative.at(angle, {{0, 0}}), exact, s.tool.radius()));
      regenerative.push({{0, 0}});
    }
    EXPECT_LT(of_rigid, 2e-5 * largest) << s.tool.teeth << " teeth, depth " << s.cut.axial_depth;
    EXPECT_LT(of_regenerative, 2e-6 * largest) << s.tool.teeth << " teeth, depth " << s.cut.axial_depth;
  }
}

// The stored surface and the history of passes are two roads to the same chip: runout so large that teeth
// leave the cut, and a tool that vibrates.
TEST(SteadyCut, isWhatTheStoredSurfaceGives) {
  MachineModel model;
  model.tool = ToolGeometry{3, 12e-3, units::radFromDeg(35.0), {}};
  model.cutting = CuttingCoefficients{953e6, 357e6, 188e6, 17.3e3, 17.7e3, 0.72e3};
  EffectEntry runout;
  runout.name = "runout";
  runout.numbers = {{"offset_um", 30.0}, {"angle_deg", 40.0}};
  model.effects = {runout};
  for (const bool flexible : {false, true}) {
    if (flexible) {
      model.tool_tip.x.modes = {{1210.0, 0.031, 1.0 / 28e6}};
      model.tool_tip.y.modes = {{1180.0, 0.029, 1.0 / 31e6}};
      model.effects.push_back(effectEntry("process_damping", {{"coefficient_n_per_mm", 200.0}}));
    }
    const double speed = units::radPerSecFromRpm(4500.0), dt = 1.0 / 204800.0;
    CuttingMachine steady(model, dt, Feed::steady), any(model, dt);
    CuttingMachine::Input input;
    input.motion.speed = speed;
    input.motion.velocity[0] = 4e-5 * 3 * speed / TWO_PI;
    steady.engage({{0.0, PI, 1e-3}}, input.motion);
    any.engage({{0.0, PI, 1e-3}}, input.motion);
    double squares = 0.0, difference = 0.0, bend = 0.0, bend_difference = 0.0;
    for (int i = 0; i < 30000; ++i) {
      input.motion.angle = speed * i * dt;
      input.motion.centre[0] = input.motion.velocity[0] * i * dt;
      const CuttingMachine::Output a = steady.step(input), b = any.step(input);
      squares += a.force.fx * a.force.fx;
      difference += std::pow(a.force.fx - b.force.fx, 2);
      bend += std::pow(a.displacement[1], 2);
      bend_difference += std::pow(a.displacement[1] - b.displacement[1], 2);
    }
    // The stored surface has nodes 0.09 degrees apart; its slices of 1.1 degrees of lag leave the cut one by
    // one.
    EXPECT_LT(std::sqrt(difference / squares), 1e-2) << flexible;
    EXPECT_LE(std::sqrt(bend_difference), 1e-2 * std::sqrt(bend)) << flexible;
    EXPECT_EQ(bend > 0.0, flexible);
  }
}

// A vibrating tool leaves marks on the walls of a slot, where no feed takes them away. They belong to two
// points of the turn and must not hold off the next teeth: once settled, every tooth meets the same chip, and
// what the sensor shows is the same by both roads. (A mark smeared over a node's width delays the edge force
// at the wall and rings in the sensor with more than a newton at every feed.)
TEST(SteadyCut, marksOnTheWallsOfASlotDoNotLast) {
  MachineModel model;
  model.tool = ToolGeometry{4, 19.05e-3, units::radFromDeg(30.0), {}};
  model.cutting = ALUMINIUM;
  model.tool_tip.x.modes = {{1210.0, 0.031, 1.0 / 28e6}, {2300.0, 0.020, 1.0 / 60e6}};
  model.tool_tip.y.modes = {{1180.0, 0.029, 1.0 / 31e6}, {2150.0, 0.025, 1.0 / 55e6}};
  model.force_sensor.axis[0].modes = {{930.0, 0.02, 0.9}};
  model.force_sensor.axis[1].modes = {{1080.0, 0.025, 0.9}};
  const double speed = units::radPerSecFromRpm(4000.0), dt = 1.0 / 102400.0;
  for (const double feed_per_tooth : {1e-4, 1.5e-4}) {
    CuttingMachine steady(model, dt, Feed::steady), any(model, dt);
    CuttingMachine::Input input;
    input.motion.speed = speed;
    input.motion.velocity[0] = feed_per_tooth * 4 * speed / TWO_PI;
    steady.engage({{0.0, PI, 1e-3}}, input.motion);
    any.engage({{0.0, PI, 1e-3}}, input.motion);
    double difference = 0.0;
    int count = 0;
    for (int i = 0; i < 102400; ++i) {
      input.motion.angle = speed * i * dt;
      input.motion.centre[0] = input.motion.velocity[0] * i * dt;
      const CuttingMachine::Output a = steady.step(input), b = any.step(input);
      if (i < 92160) continue;  // 0.9 s of settling
      difference += std::pow(a.sensor[1] - b.sensor[1], 2);
      ++count;
    }
    // Slices of the stored surface leave the work one by one: 0.16 N at this moment of the steps.
    EXPECT_LT(std::sqrt(difference / count), 0.3) << feed_per_tooth;
  }
}

TEST(SteadyCut, depthMayChangeWhileItCuts) {
  const Setting s = settings()[0];
  CuttingLaw law;
  law.coefficients = ALUMINIUM;
  RigidCut shallow(s.tool, law), deep(s.tool, law);
  deep.engage({{0.0, PI, 3e-3}}, motionOf(s, 400.0));
  shallow.engage({{0.0, PI, 2e-3}}, motionOf(s, 400.0));
  shallow.setDepths({3e-3});
  EXPECT_NEAR(shallow.at(1.0).fy, deep.at(1.0).fy, 1e-9);
  EXPECT_THROW(shallow.engage({{0.0, PI, 0.0}}, {}), Error);
  RegenerativeCut standing(s.tool, law, 1e-5);
  EXPECT_THROW(standing.engage({{0.0, PI, 1e-3}}, {}), Error);
}

}  // namespace
}  // namespace smartmill::sim
