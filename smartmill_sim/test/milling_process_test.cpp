#include "smartmill_sim/twin/milling_process.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/testing/disc_mill.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/effects/effect_set.h"
#include "smartmill_sim/twin/cutter.h"
#include "smartmill_sim/twin/cutting_machine.h"
#include "smartmill_sim/twin/tool_contact.h"

namespace smartmill::sim {
namespace {

using units::PI;
using units::TWO_PI;

const CuttingCoefficients ALUMINIUM{796e6, 168e6, 222e6, 27.7e3, 30.8e3, 1.4e3};

CuttingLaw aluminium() {
  CuttingLaw law;
  law.coefficients = ALUMINIUM;
  return law;
}

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

double largestDifference(const CuttingForce& a, const CuttingForce& b, double radius) {
  return std::max({std::abs(a.fx - b.fx), std::abs(a.fy - b.fy), std::abs(a.fz - b.fz),
                   std::abs(a.torque - b.torque) / radius});
}

/// Largest difference of any force component over a few revolutions, as a share of the largest force.
double largestError(const ToolGeometry& tool, const Engagement& cut, double rpm, int steps_per_rev) {
  const double speed = units::radPerSecFromRpm(rpm), dt = TWO_PI / speed / steps_per_rev;
  const double feed = cut.feed_per_tooth * tool.teeth * speed / TWO_PI;
  MillingProcess process(tool, aluminium(), dt);
  const MechanisticForce closed(tool, ALUMINIUM, cut);
  process.engage({{cut.entry, cut.exit, cut.axial_depth}}, motionAt(0.0, speed, feed));
  double worst = 0.0, largest = 0.0;
  for (int i = 0; i < 3 * steps_per_rev; ++i) {
    const ToolMotion motion = motionAt(i * dt, speed, feed);
    const CuttingForce f = process.step(motion), e = closed.at(motion.angle);
    process.endStep({{0.0, 0.0}});
    worst = std::max(worst, largestDifference(f, e, tool.radius()));
    largest = std::max({largest, std::abs(e.fx), std::abs(e.fy)});
  }
  return worst / largest;
}

// Steady cutting with a rigid even tool has a closed form (eq. 3.13..3.15 integrated along the helix).
TEST(MillingProcess, rigidSteadyCutMatchesTheClosedForm) {
  EXPECT_LT(largestError(endMill(4, 30.0), {0.0, PI, 2e-3, 6e-5}, 4500.0, 1731), 2e-6);
  EXPECT_LT(largestError(endMill(4, 30.0), {0.0, 0.5 * PI, 4e-3, 8e-5}, 4500.0, 1731), 2e-6);
  EXPECT_LT(largestError(endMill(4, 30.0), {0.5 * PI, PI, 4e-3, 8e-5}, 13950.0, 381), 2e-6);
  EXPECT_LT(largestError(endMill(1, 45.0), {1.2, 1.3, 10e-3, 5e-5}, 600.0, 3973), 2e-6);
  EXPECT_LT(largestError(endMill(2, 0.0), {0.4, 2.2, 3e-3, 1e-4}, 6000.0, 1001), 2e-6);
  EXPECT_LT(largestError(endMill(4, 45.0), {0.0, PI, 70e-3, 5e-5}, 6000.0, 1001),
            2e-6);  // lags by more than a revolution
}

// A ball end in the solid on a ramp: an axial feed advances the inclined edge too.
TEST(Cutter, anAxialFeedIsCutByAnInclinedEdge) {
  constexpr int STEPS = 1440;
  constexpr double SPEED = 471.0, FEED = 6e-5, DT = TWO_PI / SPEED / STEPS;
  ToolGeometry ball = endMill(2, 30.0);
  ball.edge.corner_radius = ball.radius();
  const double depth = edgeSlices(ball, 0.0)[4].high;         // whole slices
  for (const double slope : {-0.3, -0.05, 0.0, 0.05, 0.3}) {  // up to down
    Cutter cutter(ball, aluminium(), DT, {}, 0.0, Cutter::Method::history);
    const auto at = [&](int step) {
      ToolMotion motion = motionAt(step * DT, SPEED, FEED * ball.teeth * SPEED / TWO_PI);
      motion.sink = slope * motion.velocity[0];
      return motion;
    };
    Engagement cut{0.0, PI, depth, FEED};
    cut.axial_feed_per_tooth = slope * FEED;
    const MechanisticForce closed(ball, ALUMINIUM, cut);
    cutter.engage({{0.0, PI, depth}}, at(0));
    CuttingForce mean;
    for (int i = 0; i < 2 * STEPS; ++i) {
      const CuttingForce f = cutter.step(at(i));
      cutter.endStep({{0.0, 0.0}});
      if (i >= STEPS) mean.add(f, 1.0 / STEPS);
    }
    const CuttingForce expected = closed.mean();
    EXPECT_NEAR(mean.fx, expected.fx, 2e-3 * std::abs(expected.fy)) << slope;
    EXPECT_NEAR(mean.fy, expected.fy, 2e-3 * std::abs(expected.fy)) << slope;
    EXPECT_NEAR(mean.fz, expected.fz, 2e-3 * std::abs(expected.fy)) << slope;
    EXPECT_NEAR(mean.torque, expected.torque, 2e-3 * expected.torque) << slope;
  }
}

// A depth error lengthens what ends in the work's surface; a band with another one on it keeps its end.
TEST(ToolContact, aDepthErrorLengthensTheUpperBands) {
  ToolContact contact;
  contact.engage({{0.0, 2.0, 1e-3, 0.0}, {2.5, 3.0, 0.8e-3, 0.0}, {0.0, 1.5, 2e-3, 1e-3}},
                 motionAt(0.0, 471.0, 0.01), 0.0);
  TwinState state;
  state.depth_extra = 1e-4;
  const std::vector<ContactArc> arcs = contact.actualArcs(state);
  EXPECT_EQ(arcs[0].depth, 1e-3);
  EXPECT_NEAR(arcs[1].depth, 0.9e-3, 1e-12);
  EXPECT_NEAR(arcs[2].depth, 2.1e-3, 1e-12);
  EXPECT_EQ(arcs[2].bottom, 1e-3);
}

/// A slot with four straight teeth, of which one breaks after two revolutions and is whole again after five.
struct BrokenTooth {
  static constexpr int TEETH = 4, STEPS = 1200, LOST = 2, BREAKS = 2 * STEPS + 357, WHOLE = 5 * STEPS + 101;
  static constexpr double SPEED = 471.0, FEED = 6e-5, DEPTH = 2e-3;  // [rad/s], [m] per tooth, [m]
  const ToolGeometry tool = endMill(TEETH, 0.0);

  ToolMotion motion(int step) const {
    ToolMotion at = motionAt(step * TWO_PI / SPEED / STEPS, SPEED, FEED * TEETH * SPEED / TWO_PI);
    at.angle = angle(step);
    return at;
  }
  static double angle(int step) { return 1e-4 + TWO_PI * step / STEPS; }
  /// Force of each step. @param only tooth, -1: all
  std::vector<CuttingForce> simulate(double length, int only = -1) const {
    MillingProcess process(tool, aluminium(), TWO_PI / SPEED / STEPS);
    if (only >= 0) process.selectTooth(only);
    process.engage({{0.0, PI, DEPTH}}, motion(0));
    std::vector<CuttingForce> forces;
    for (int i = 0; i < 8 * STEPS; ++i) {
      if (i == BREAKS) process.setRadii({0.0, 0.0, -length, 0.0});
      if (i == WHOLE) process.setRadii({0.0, 0.0, 0.0, 0.0});
      forces.push_back(process.step(motion(i)));
      process.endStep({{0.0, 0.0}});
    }
    return forces;
  }
  /// The least distance to the surfaces of all earlier passes, each with the radius of its tooth at that
  /// time.
  CuttingForce expected(int step, double length) const {
    CuttingForce sum;
    for (int j = 0; j < TEETH; ++j) {
      const double phi = std::fmod(angle(step) + j * TWO_PI / TEETH, TWO_PI);
      if (phi > PI) continue;
      const auto radius = [&](int tooth, int at) {
        return tooth == LOST && at >= BREAKS && at < WHOLE ? -length : 0.0;
      };
      double chip = 1.0;
      for (int n = 1; n <= 40; ++n)
        chip = std::min(chip, n * FEED * std::sin(phi) +
                                  (n * n - 1) * std::pow(FEED * std::cos(phi), 2) / tool.diameter +
                                  radius(j, step) - radius((j + n) % TEETH, step - n * STEPS / TEETH));
      if (chip <= 0.0) continue;
      const CuttingCoefficients& k = ALUMINIUM;
      sum.add(toolForce(DEPTH * (k.ktc * chip + k.kte), DEPTH * (k.krc * chip + k.kre),
                        DEPTH * (k.kac * chip + k.kae), phi, tool.radius()));
    }
    return sum;
  }
  static double meanTorque(const std::vector<CuttingForce>& forces, int revolution) {
    double sum = 0.0;
    for (int i = 0; i < STEPS; ++i)
      sum += forces[static_cast<std::size_t>(revolution * STEPS + i)].torque / STEPS;
    return sum;
  }
};

// Lost, and shortened by less and by more than a chip: the exact rule at every angle, also in the revolutions
// in which surfaces of the former teeth are left.
TEST(MillingProcess, aBrokenToothLeavesItsChipToTheNextOne) {
  const BrokenTooth cut;
  for (const double length : {1e-3, 2e-5, 1e-4}) {
    const std::vector<CuttingForce> forces = cut.simulate(length);
    double worst = 0.0, largest = 0.0;
    for (int i = 0; i < static_cast<int>(forces.size()); ++i) {
      const CuttingForce expected = cut.expected(i, length);
      worst = std::max(worst,
                       largestDifference(forces[static_cast<std::size_t>(i)], expected, cut.tool.radius()));
      largest = std::max({largest, std::abs(expected.fx), std::abs(expected.fy)});
    }
    EXPECT_LT(worst / largest, 1e-6) << length;
  }
}

// Revolution 1 is before the loss, 4 with the lost tooth, 7 after renewal of the surfaces.
TEST(MillingProcess, theToothAfterALostOneHasTwiceTheChip) {
  const BrokenTooth cut;
  const std::vector<CuttingForce> lost = cut.simulate(1e-3, BrokenTooth::LOST),
                                  next = cut.simulate(1e-3, BrokenTooth::LOST - 1), all = cut.simulate(1e-3);
  const double edge = 0.5 * ALUMINIUM.kte * BrokenTooth::DEPTH * cut.tool.radius();  // cuts half of the time
  const double before = BrokenTooth::meanTorque(next, 1), after = BrokenTooth::meanTorque(next, 4);
  EXPECT_DOUBLE_EQ(BrokenTooth::meanTorque(lost, 4), 0.0);
  EXPECT_NEAR((after - edge) / (before - edge), 2.0, 0.01);  // roundness of the tool: feed / radius
  EXPECT_NEAR(BrokenTooth::meanTorque(all, 4), BrokenTooth::meanTorque(all, 1) - edge,
              0.003 * BrokenTooth::meanTorque(all, 1));
  for (int i = 0; i < BrokenTooth::STEPS; ++i) {
    const auto at = [&](int revolution) {
      return all[static_cast<std::size_t>(revolution * BrokenTooth::STEPS + i)];
    };
    ASSERT_LT(largestDifference(at(7), at(1), cut.tool.radius()), 1e-6) << i;  // [N]
  }
}

TEST(MillingProcess, refusesRadiiOfAnotherNumberOfTeeth) {
  MillingProcess process(endMill(4, 30.0), aluminium(), 1e-5);
  EXPECT_THROW(process.setRadii({0.0, 0.0}), Error);
}

/// A prescribed motion of spindle and tool.
struct PrescribedMotion {
  std::function<double(double)> time;                                 // [s] by angle of the spindle [rad]
  std::function<std::array<double, 2>(double)> centre, displacement;  // [m] by time
  std::function<double(double)> speed;                                // [rad/s] by time
  std::function<double(double)> turned;                               // [rad] by time
};

double derivative(const std::function<double(double)>& f, double t) {
  constexpr double H = 1e-6;
  return (f(t + H) - f(t - H)) / (2.0 * H);
}

/// Largest deviation from a sum over discs under a prescribed motion, relative to the largest force: with the
/// ChipRule (share 0) or with the paths of the teeth.
double largestDeviation(const PrescribedMotion& path, const ToolGeometry& tool,
                        const std::vector<double>& radius, const CuttingLaw& law, double duration,
                        double share = 0.0, bool by_path = false) {
  testing::DiscMill reference{tool, law, radius, [&](double turned) {
                                const double t = path.time(turned);
                                testing::DiscMill::State state{turned, path.centre(t), {{0.0, 0.0}}};
                                state.speed = path.speed(t);
                                if (t < 0.0) return state;
                                state.displacement = path.displacement(t);
                                for (std::size_t i = 0; i < 2; ++i)
                                  state.rate[i] =
                                      derivative([&](double s) { return path.displacement(s)[i]; }, t);
                                return state;
                              }};
  reference.by_path = by_path;
  if (by_path) reference.passes = 6;  // older surfaces are not in contact
  const double dt = 1e-5, depth = 1.5e-3;
  const auto motionOf = [&](double t) {
    ToolMotion motion;
    motion.angle = path.turned(t);
    motion.speed = path.speed(t);
    motion.centre = path.centre(t);
    for (std::size_t i = 0; i < 2; ++i)
      motion.velocity[i] = derivative([&](double s) { return path.centre(s)[i]; }, t);
    motion.displacement = path.displacement(t);
    for (std::size_t i = 0; i < 2; ++i)
      motion.rate[i] = derivative([&](double s) { return path.displacement(s)[i]; }, t);
    return motion;
  };
  MillingProcess process(tool, law, dt, radius, share);
  process.engage({{0.1, 2.9, depth}}, motionOf(0.0));
  double worst = 0.0, largest = 0.0;
  const auto steps = static_cast<int>(duration / dt);
  for (int i = 0; i < steps; ++i) {
    const ToolMotion motion = motionOf(i * dt);
    const CuttingForce force = process.step(motion);
    process.endStep(motion.displacement);
    if (i % 41 != 7) continue;
    const CuttingForce expected = reference.force(motion.angle, 0.1, 2.9, depth, 300);
    worst = std::max(worst, largestDifference(force, expected, tool.radius()));
    largest = std::max({largest, std::abs(expected.fx), std::abs(expected.fy)});
  }
  return worst / largest;
}

std::array<double, 2> shaking(double t) {
  return {{9e-6 * std::sin(8100.0 * t) + 4e-6 * std::sin(2300.0 * t),
           12e-6 * std::sin(7300.0 * t + 1.0) - 10e-6}};
}

// @param feed [m] per revolution
PrescribedMotion steadyPath(double feed, std::function<std::array<double, 2>(double)> displacement) {
  constexpr double SPEED = 471.0;  // [rad/s]
  return {[](double turned) { return turned / SPEED; },
          [=](double t) {
            return std::array<double, 2>{{feed * SPEED / TWO_PI * t, 0.0}};
          },
          std::move(displacement), [](double) { return SPEED; }, [](double t) { return SPEED * t; }};
}

// Any vibration, runout and pitch: the surface of earlier teeth remains until the feed or the tool's
// curvature has removed it.
TEST(MillingProcess, matchesTheChipRuleSummedOverDiscs) {
  const PrescribedMotion path = steadyPath(4.0 * 3e-5, shaking);
  ToolGeometry tool = endMill(4, 30.0);
  EXPECT_LT(largestDeviation(path, tool, {0, 0, 0, 0}, aluminium(), 0.12), 0.01);
  tool.pitch = {1.5, 1.65, 1.55, TWO_PI - 4.7};
  CuttingLaw law = aluminium();
  law.damping = 2e5;
  law.size_exponent = 0.15;
  law.edge_chip = 4e-6;
  EXPECT_LT(largestDeviation(path, tool, {0.0, 14e-6, -6e-6, 5e-6}, law, 0.12), 0.01);
}

std::array<double, 2> swinging(double t) {
  return {{60e-6 * std::sin(5200.0 * t), 90e-6 * std::sin(4700.0 * t)}};
}

// With the full path of the teeth: a surface is met at the angle at which its tooth crossed the ray.
TEST(MillingProcess, surfacesFollowThePathsOfTheTeeth) {
  const PrescribedMotion path = steadyPath(4.0 * 2e-4, swinging);
  ToolGeometry tool = endMill(4, 30.0);
  const std::vector<double> even(4, 0.0);
  EXPECT_LT(largestDeviation(path, tool, even, aluminium(), 0.06, 1.0, true), 0.01);
  const double by_rule = largestDeviation(path, tool, even, aluminium(), 0.06, 0.0, true);
  EXPECT_GT(by_rule, 0.1);
  EXPECT_NEAR(largestDeviation(path, tool, even, aluminium(), 0.06, 0.5, true), 0.5 * by_rule, 0.1 * by_rule);
  tool.pitch = {1.5, 1.65, 1.55, TWO_PI - 4.7};
  EXPECT_LT(largestDeviation(path, tool, {0.0, 14e-6, -6e-6, 5e-6}, aluminium(), 0.06, 1.0, true), 0.01);
}

// The spindle runs up and the feed turns into a curve at the same time.
TEST(MillingProcess, speedAndFeedMayChange) {
  const double begin = 400.0, rise = 1200.0, feed = 9e-3, bend = 4.0;
  // turned = begin t + rise t^2 / 2; constant speed and feed before t = 0.
  const auto speed = [=](double t) { return t < 0.0 ? begin : begin + rise * t; };
  const auto turned = [=](double t) { return t < 0.0 ? begin * t : begin * t + 0.5 * rise * t * t; };
  const auto time = [=](double angle) {
    return angle < 0.0 ? angle / begin : (std::sqrt(begin * begin + 2.0 * rise * angle) - begin) / rise;
  };
  const auto centre = [=](double t) {
    if (t < 0.0) return std::array<double, 2>{{feed * t, 0.0}};
    return std::array<double, 2>{
        {feed / bend * std::sin(bend * t), feed / bend * (1.0 - std::cos(bend * t))}};
  };
  const PrescribedMotion path{time, centre, shaking, speed, turned};
  EXPECT_LT(largestDeviation(path, endMill(4, 30.0), {0.0, 14e-6, -6e-6, 5e-6}, aluminium(), 0.12), 0.01);
  const PrescribedMotion wide{time, centre, swinging, speed, turned};
  EXPECT_LT(largestDeviation(wide, endMill(4, 30.0), {0.0, 14e-6, -6e-6, 5e-6}, aluminium(), 0.06, 1.0, true),
            0.01);
}

// Steady cutting after a change equals that without it, once the earlier surfaces are cut away.
TEST(MillingProcess, aChangeIsForgotten) {
  const double speed = 500.0, dt = 1e-5, feed = 4.0 * 5e-5 * speed / TWO_PI;
  const ToolGeometry tool = endMill(4, 30.0);
  const std::vector<double> radius{0.0, 14e-6, -6e-6, 5e-6};
  MillingProcess steady(tool, aluminium(), dt, radius), changed(tool, aluminium(), dt, radius);
  ToolMotion motion = motionAt(0.0, speed, feed), slower = motion;
  slower.velocity[0] = 0.4 * feed;
  steady.engage({{0.0, PI, 1e-3}}, motion);
  changed.engage({{0.0, PI, 1e-3}}, slower);
  for (int i = 0; i < 20000; ++i) {
    const double t = i * dt;
    motion = motionAt(t, speed, feed);
    slower = motion;
    if (i < 4000) slower.velocity[0] = 0.4 * feed;
    slower.centre[0] -= 0.6 * feed * std::min(t, 4000 * dt);
    motion.displacement = slower.displacement = shaking(t);
    const CuttingForce a = steady.step(motion), b = changed.step(slower);
    steady.endStep(motion.displacement);
    changed.endStep(slower.displacement);
    if (i > 14000) {
      ASSERT_LT(largestDifference(a, b, tool.radius()), 1e-3) << i;
    }
  }
}

/// Growth of the vibration of a tool with one mode: its norm in the last quarter of a cut over that in the
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
  const double feed = 2e-4 * 2.0 * speed / TWO_PI;  // large, so that the tool does not leave the cut
  CuttingMachine::Input input;
  input.motion = motionAt(0.0, speed, feed);
  machine.engage({{0.0, PI, depth}}, input.motion);
  const int revolutions = 240;
  std::vector<double> x;
  for (int i = 0; i < revolutions * steps_per_rev; ++i) {
    input.motion = motionAt(i * dt, speed, feed);
    // A force pulse in the first revolution.
    input.tip_force[0] = i < steps_per_rev / 8 ? 1.0 : 0.0;
    x.push_back(machine.step(input).displacement[0]);
  }
  // The difference between revolutions is the vibration that grows or decays.
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

// Stability limits by converged Chebyshev collocation (see the stability oracles): slot, one mode in x.
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

// Four straight teeth in a slot: the squares of the sines of the two engaged ones sum to 1, so that rubbing
// edges are a damper of C b / v_c in x. The mode is overdamped: c/m times the step is 2.5 and 1.3.
TEST(CuttingMachine, rubbingEdgesAreADamper) {
  constexpr double DAMPING = 640e3, DEPTH = 2e-3, STIFFNESS = 13e6, FREQUENCY = 5000.0, RATIO = 0.03;
  MachineModel model;
  model.tool = endMill(4, 0.0);
  model.cutting = CuttingCoefficients{};
  model.tool_tip.x.modes = {{FREQUENCY, RATIO, 1.0 / STIFFNESS}};
  model.effects = {effectEntry("process_damping", {{"coefficient_n_per_mm", 1e-3 * DAMPING}})};
  const double speed = 125.0, w0 = TWO_PI * FREQUENCY, w = TWO_PI * 1000.0;
  const double mass = STIFFNESS / (w0 * w0);
  const double rubbing = DAMPING * DEPTH / (speed * model.tool->radius());
  const std::complex<double> compliance =
      1.0 / std::complex<double>(STIFFNESS - mass * w * w, w * (2.0 * RATIO * w0 * mass + rubbing));
  for (const double rate : {25600.0, 51200.0}) {
    CuttingMachine machine(model, 1.0 / rate);
    CuttingMachine::Input input;
    input.motion = motionAt(0.0, speed, 1e-2);
    machine.engage({{0.0, PI, DEPTH}}, input.motion);
    std::complex<double> response = 0.0;
    const auto steps = static_cast<int>(0.2 * rate);
    for (int i = 0; i < steps; ++i) {
      input.motion = motionAt(i / rate, speed, 1e-2);
      input.tip_force[0] = std::cos(w * i / rate);
      const double x = machine.step(input).displacement[0];
      if (2 * i >= steps) response += x * std::polar(4.0 / steps, -w * i / rate);
    }
    EXPECT_LT(std::abs(response / compliance - 1.0), 0.02) << rate;
  }
}

TEST(MillingProcess, runoutLeavesTheCutToOneToothOfTwo) {
  // Offset over half the feed: tooth 1 takes the chip of both, tooth 2 never touches.
  CuttingLaw law;
  law.coefficients = {1e9, 0.0, 0.0, 0.0, 0.0, 0.0};
  const double f = 5e-5, speed = 500.0, feed = f * 2.0 * speed / TWO_PI, depth = 1e-3;
  const double dt = TWO_PI / speed / 1000.0;
  MillingProcess process(endMill(2, 0.0), law, dt, {30e-6, -30e-6});
  process.engage({{0.0, PI, depth}}, motionAt(0.0, speed, feed));
  double first = 0.0, second = 0.0;
  for (int i = 0; i < 5000; ++i) {
    const ToolMotion motion = motionAt(i * dt, speed, feed);
    const CuttingForce force = process.step(motion);
    process.endStep({{0.0, 0.0}});
    const double angle = std::fmod(motion.angle, TWO_PI);
    double& peak = angle < PI ? first : second;
    peak = std::max(peak, force.torque);
  }
  // At the thickest chip, in feed direction, the tool's curvature has no effect.
  EXPECT_NEAR(first, 1e9 * 2.0 * f * depth * 0.5 * 19.05e-3, 1e-4 * first);
  EXPECT_EQ(second, 0.0);
}

// Tables and history give the same forces for a rigid tool with runout and variable pitch.
TEST(MillingProcess, equalsRigidCutWithoutVibration) {
  MachineModel model;
  model.tool = ToolGeometry{3, 12e-3, units::radFromDeg(35.0), {2.0, 2.2, TWO_PI - 4.2}};
  model.cutting = CuttingCoefficients{953e6, 357e6, 188e6, 17.3e3, 17.7e3, 0.72e3};
  model.effects = {effectEntry("runout", {{"offset_um", 30.0}, {"angle_deg", 40.0}})};
  const double speed = units::radPerSecFromRpm(4500.0), dt = 1.0 / 51200.0;
  CuttingMachine steady(model, dt, Feed::steady), any(model, dt);
  CuttingMachine::Input input;
  input.motion = motionAt(0.0, speed, 4e-5 * 3 * speed / TWO_PI);
  steady.engage({{0.0, PI, 1e-3}}, input.motion);
  any.engage({{0.0, PI, 1e-3}}, input.motion);
  double squares = 0.0;
  const int steps = 5000;
  for (int i = 0; i < steps; ++i) {
    input.motion = motionAt(i * dt, speed, 4e-5 * 3 * speed / TWO_PI);
    const CuttingForce a = steady.step(input).force, b = any.step(input).force;
    // A quarter of the edge force over a cell of the tables (0.46 N) while a contact begins or ends in it.
    const double difference = largestDifference(a, b, 6e-3);
    ASSERT_LT(difference, 0.15) << i;
    squares += difference * difference;
  }
  EXPECT_LT(std::sqrt(squares / steps), 0.02);
}

TEST(MillingProcess, refusesInvalidContact) {
  CuttingLaw law;
  MillingProcess process(endMill(2, 0.0), law, 1e-5);
  const ToolMotion turning = motionAt(0.0, 100.0, 0.0);
  EXPECT_THROW(process.engage({{0.5, 0.5, 1e-3}}, turning), Error);
  EXPECT_THROW(process.engage({{0.0, 7.0, 1e-3}}, turning), Error);
  EXPECT_THROW(process.engage({{0.0, 1.0, 0.0}}, turning), Error);
  EXPECT_THROW(process.engage({{0.0, PI, 1e-3}}, {}), Error);  // the spindle is at rest
  EXPECT_THROW(process.engage({{0.0, PI, 1e-3}}, motionAt(0.0, 200000.0, 0.0)),
               Error);  // less than two steps per tooth
  EXPECT_THROW(MillingProcess(endMill(2, 0.0), law, 1e-5, {1e-6}), Error);
}

}  // namespace
}  // namespace smartmill::sim
