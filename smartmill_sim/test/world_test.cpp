#include "smartmill_sim/world/world.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/signal/pulse_tachometer.h"
#include "smartmill_core/testing/mill.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/world/hammer_station.h"
#include "smartmill_sim/world/stock.h"

namespace smartmill::sim {
namespace {

using units::PI;
constexpr double RADIUS = 8e-3;

Workpiece box() {
  Workpiece w;
  w.material = "al";
  w.low = {-50e-3, -40e-3, -30e-3};
  w.high = {50e-3, 40e-3, 0.0};
  return w;
}

ToolGeometry endMill(double radius, double corner_radius = 0.0) {
  ToolGeometry tool;
  tool.teeth = 4;
  tool.diameter = 2.0 * radius;
  tool.edge.corner_radius = corner_radius;
  return tool;
}

// ---- stock

TEST(Stock, FullSlotIsHalfTheTool) {
  const Stock stock(box(), endMill(RADIUS));
  const std::vector<ContactArc> arcs = stock.contact({0.0, 0.0, -2e-3}, {0.01, 0.0, 0.0});
  ASSERT_EQ(arcs.size(), 1u);
  EXPECT_NEAR(arcs[0].entry, 0.0, 1e-9);
  EXPECT_NEAR(arcs[0].exit, PI, 1e-9);
  EXPECT_NEAR(arcs[0].depth, 2e-3, 1e-12);
}

// Width ae at the edge of the stock: up-milling leaves at acos(1 - ae / R), down-milling enters at
// pi - acos(1 - ae / R) (Altintas, Manufacturing Automation, eq. 2.72).
TEST(Stock, SideCutsHaveTheTextbookImmersion) {
  const Stock stock(box(), endMill(RADIUS));
  const double ae = 2e-3, immersion = std::acos(1.0 - ae / RADIUS);
  // Feed in +x with the stock on the side of +y: the tool overlaps it by ae from y = -40 mm on.
  const std::vector<ContactArc> up = stock.contact({0.0, -40e-3 - RADIUS + ae, -1e-3}, {0.01, 0.0, 0.0});
  ASSERT_EQ(up.size(), 1u);
  EXPECT_NEAR(up[0].entry, 0.0, 1e-9);
  EXPECT_NEAR(up[0].exit, immersion, 1e-6);
  const std::vector<ContactArc> down = stock.contact({0.0, 40e-3 + RADIUS - ae, -1e-3}, {0.01, 0.0, 0.0});
  ASSERT_EQ(down.size(), 1u);
  EXPECT_NEAR(down[0].entry, PI - immersion, 1e-6);
  EXPECT_NEAR(down[0].exit, PI, 1e-9);
}

TEST(Stock, EnteringTheFrontGrowsFromTheMiddle) {
  const Stock stock(box(), endMill(RADIUS));
  // The tip of the circle is 1 mm inside: half angle acos(1 - 1 / 8) about the feed direction.
  const std::vector<ContactArc> arcs = stock.contact({-50e-3 - RADIUS + 1e-3, 0.0, -1e-3}, {0.01, 0.0, 0.0});
  const double half = std::acos(1.0 - 1e-3 / RADIUS);
  ASSERT_EQ(arcs.size(), 1u);
  EXPECT_NEAR(arcs[0].entry, 0.5 * PI - half, 1e-6);
  EXPECT_NEAR(arcs[0].exit, 0.5 * PI + half, 1e-6);
}

TEST(Stock, FeedInMinusYWrapsOverZero) {
  const Stock stock(box(), endMill(RADIUS));
  // Heading -y is the immersion angle pi: the front half is pi/2 .. 3 pi/2; +y gives 3 pi/2 .. 2 pi and 0 ..
  // pi/2.
  const std::vector<ContactArc> minus = stock.contact({0.0, 0.0, -1e-3}, {0.0, -0.01, 0.0});
  ASSERT_EQ(minus.size(), 1u);
  EXPECT_NEAR(minus[0].entry, 0.5 * PI, 1e-9);
  EXPECT_NEAR(minus[0].exit, 1.5 * PI, 1e-9);
  const std::vector<ContactArc> plus = stock.contact({0.0, 0.0, -1e-3}, {0.0, 0.01, 0.0});
  ASSERT_EQ(plus.size(), 2u);
  EXPECT_NEAR(plus[0].entry, 1.5 * PI, 1e-9);
  EXPECT_NEAR(plus[0].exit, 2.0 * PI, 1e-9);
  EXPECT_NEAR(plus[1].entry, 0.0, 1e-9);
  EXPECT_NEAR(plus[1].exit, 0.5 * PI, 1e-9);
}

TEST(Stock, ASlotIsAir) {
  Stock stock(box(), endMill(RADIUS));
  for (int k = 0; k <= 200; ++k) {
    const std::array<double, 3> at{-60e-3 + 0.6e-3 * k, 0.0, -2e-3};
    stock.cutTo(at);
    // The slot being cut is material for the tool in front.
    if (std::abs(at[0]) < 40e-3) {
      const std::vector<ContactArc> arcs = stock.contact(at, {0.01, 0.0, 0.0});
      ASSERT_EQ(arcs.size(), 1u);
      ASSERT_NEAR(arcs[0].entry, 0.0, 1e-9);
      ASSERT_NEAR(arcs[0].exit, PI, 1e-9);
    }
  }
  // Back through it.
  EXPECT_TRUE(stock.contact({40e-3, 0.0, -2e-3}, {-0.01, 0.0, 0.0}).empty());
  stock.cutTo({40e-3, 0.0, 1e-3});
  // Again at the same depth and deeper: only the material below remains.
  EXPECT_TRUE(stock.contact({0.0, 0.0, -2e-3}, {0.01, 0.0, 0.0}).empty());
  const std::vector<ContactArc> deeper = stock.contact({0.0, 0.0, -3e-3}, {0.01, 0.0, 0.0});
  ASSERT_EQ(deeper.size(), 1u);
  EXPECT_NEAR(deeper[0].depth, 1e-3, 1e-9);
  // Offset by 12 mm: the tool overlaps the slot from 12 - 8 = 4 mm off its axis on.
  const std::vector<ContactArc> side_cut = stock.contact({0.0, 12e-3, -2e-3}, {0.01, 0.0, 0.0});
  ASSERT_EQ(side_cut.size(), 1u);
  EXPECT_NEAR(side_cut[0].entry, 0.0, 1e-9);
  EXPECT_NEAR(side_cut[0].exit, PI - std::acos(4e-3 / RADIUS), 1e-6);
  EXPECT_FALSE(stock.hasMaterialAbove({0.0, 0.0, -2e-3}));
  EXPECT_TRUE(stock.hasMaterialAbove({0.0, 0.0, -2.1e-3}));
  EXPECT_TRUE(stock.hasMaterialAbove({0.0, 12e-3, -2e-3}));
}

// Exit at one end and entry at another, at the same depth: the material between remains.
TEST(Stock, ASlotEndsWhereTheToolLeaves) {
  Stock stock(box(), endMill(RADIUS));
  stock.cutTo({-40e-3, 40e-3, -2e-3});
  stock.cutTo({60e-3, 40e-3, -2e-3});
  stock.endSlot();
  stock.cutTo({-60e-3, 20e-3, -2e-3});
  const std::vector<ContactArc> arcs = stock.contact({0.0, 24e-3, -2e-3}, {0.0, -0.01, 0.0});
  ASSERT_EQ(arcs.size(), 1u);
  EXPECT_NEAR(arcs[0].entry, 0.5 * PI, 1e-9);
  EXPECT_NEAR(arcs[0].exit, 1.5 * PI, 1e-9);
}

// A small tool next to the slot of a larger one, and on a ramp into the floor of it.
TEST(Stock, KeepsTheWidthOfEachToolsSlots) {
  constexpr double SMALL = 3e-3;
  Stock stock(box(), endMill(RADIUS));
  stock.cutTo({-60e-3, 0.0, -2e-3});
  stock.cutTo({60e-3, 0.0, -2e-3});
  stock.endSlot();
  stock.changeTool(endMill(SMALL));
  // Its axis is 1 mm within the wall: the part of the circle beyond the wall cuts.
  const std::vector<ContactArc> side = stock.contact({0.0, RADIUS - 1e-3, -2e-3}, {0.01, 0.0, 0.0});
  ASSERT_EQ(side.size(), 1u);
  EXPECT_NEAR(side[0].entry, 0.0, 1e-9);
  EXPECT_NEAR(side[0].exit, std::acos(1e-3 / SMALL), 1e-6);
  EXPECT_TRUE(stock.contact({0.0, RADIUS - SMALL, -2e-3}, {0.01, 0.0, 0.0}).empty());
  stock.cutTo({0.0, 0.0, -2.1e-3});
  stock.cutTo({1e-3, 0.0, -2.2e-3});
  const std::vector<ContactArc> ramp = stock.contact({2e-3, 0.0, -2.3e-3}, {0.01, 0.0, -1e-3});
  ASSERT_FALSE(ramp.empty());
  EXPECT_NEAR(ramp[0].depth, 0.3e-3, 1e-9);
}

// At each height h a ball of radius R is a circle of radius r = sqrt(R^2 - (R - h)^2).
double circleOfBall(double radius, double height) {
  return std::sqrt(height * (2.0 * radius - height));
}

TEST(Stock, ABallInTheSolidIsHalfACircleAtEachHeight) {
  const double depth = 1.3e-3;
  const Stock stock(box(), endMill(RADIUS, RADIUS));
  const std::vector<ContactArc> arcs = stock.contact({0.0, 0.0, -depth}, {0.01, 0.0, 0.0});
  ASSERT_GT(arcs.size(), 3u);
  EXPECT_EQ(arcs.front().bottom, 0.0);
  for (std::size_t k = 0; k < arcs.size(); ++k) {
    EXPECT_NEAR(arcs[k].entry, 0.0, 1e-9);
    EXPECT_NEAR(arcs[k].exit, PI, 1e-9);
    if (k > 0) {
      EXPECT_EQ(arcs[k].bottom, arcs[k - 1].depth);
    }
  }
  EXPECT_NEAR(arcs.back().depth, depth, 1e-3 * depth);
}

// Raster with a step s in a plane: at each height the slot before has the same half width r, so that the
// material is at y > r, where s + r cos(phi) > r: from +y to acos(1 - s / r), for r < s / 2 everywhere.
TEST(Stock, ABallNextToItsLastSlotLeavesTheClosedFormOfTheStep) {
  const double depth = 1.0e-3, step = 0.8e-3;
  Stock stock(box(), endMill(RADIUS, RADIUS));
  stock.cutTo({-60e-3, 0.0, -depth});
  stock.cutTo({60e-3, 0.0, -depth});
  stock.endSlot();
  const std::vector<ContactArc> arcs = stock.contact({0.0, step, -depth}, {0.01, 0.0, 0.0});
  ASSERT_GT(arcs.size(), 3u);
  for (const ContactArc& arc : arcs) {
    const double r = circleOfBall(RADIUS, 0.5 * (arc.bottom + arc.depth));
    EXPECT_NEAR(arc.entry, 0.0, 1e-9);
    EXPECT_NEAR(arc.exit, r < 0.5 * step ? PI : std::acos(1.0 - step / r), 2e-3) << r;
  }
  EXPECT_NEAR(arcs.back().depth, depth, 1e-3 * depth);
}

// The floor of a ball's slot on a slope: a cylinder of the ball's radius along the slope, whose lowest line
// is R / cos(slope) below the centre.
TEST(Stock, ASlotOnASlopeIsATiltedCylinder) {
  constexpr double SMALL = 0.25e-3;
  const double slope = 0.1, length = 60e-3;
  Stock stock(box(), endMill(RADIUS, RADIUS));
  // Also in many parts.
  for (int k = 0; k <= 100; ++k)
    stock.cutTo({-30e-3 + 0.01 * k * length, 0.0, -1e-3 - 0.01 * k * length * slope});
  stock.endSlot();
  stock.changeTool(endMill(SMALL));
  for (const double x : {-10e-3, 0.0, 10e-3}) {
    const double centre = -1e-3 - slope * (x + 30e-3) + RADIUS;
    const double floor = centre - RADIUS * std::sqrt(1.0 + slope * slope);
    // The front of a thin tool that feeds in +y, at this x.
    const std::vector<ContactArc> arcs = stock.contact({x, -SMALL, -20e-3}, {0.0, 0.01, 0.0});
    ASSERT_FALSE(arcs.empty());
    double lowest = 1.0, highest = 0.0;
    for (const ContactArc& arc : arcs) {
      lowest = std::min(lowest, arc.depth);
      highest = std::max(highest, arc.depth);
    }
    // Across the tool the floor rises by slope times its radius.
    EXPECT_NEAR(0.5 * (lowest + highest) - 20e-3, floor, 6e-5) << x;
  }
}

// A bull nose has its corner and, above it, its side; it may plunge as little as an end mill.
TEST(Stock, ABullNoseHasACornerAndASide) {
  const double corner = 1e-3, depth = 3e-3, ae = 2e-3;
  const Stock stock(box(), endMill(RADIUS, corner));
  const std::vector<ContactArc> arcs = stock.contact({0.0, -40e-3 - RADIUS + ae, -depth}, {0.01, 0.0, 0.0});
  ASSERT_GT(arcs.size(), 2u);
  for (const ContactArc& arc : arcs) {
    const double below = corner - std::min(corner, 0.5 * (arc.bottom + std::min(arc.depth, corner)));
    const double r = RADIUS - corner + std::sqrt(corner * corner - below * below);
    EXPECT_NEAR(arc.exit, std::acos((RADIUS - ae) / r), 1e-5);
  }
  EXPECT_NEAR(arcs.back().bottom, corner, 1e-12);
  EXPECT_NEAR(arcs.back().depth, depth, 1e-12);
  EXPECT_TRUE(stock.hasMaterialAbove({0.0, 0.0, -depth}));
  EXPECT_FALSE(Stock(box(), endMill(RADIUS, RADIUS)).hasMaterialAbove({0.0, 0.0, -depth}));
}

// A rising surface of slope t advances where sin(phi) > rise / t; that of a ball at height h has the slope
// r / (R - h).
TEST(Stock, ARisingBallDoesNotCutAtItsSides) {
  const double depth = 2e-3, rise = 0.2;
  const Stock stock(box(), endMill(RADIUS, RADIUS));
  const std::vector<ContactArc> arcs = stock.contact({0.0, 0.0, -depth}, {0.01, 0.0, 0.01 * rise});
  ASSERT_GT(arcs.size(), 3u);
  for (const ContactArc& arc : arcs) {
    const double h = 0.5 * (arc.bottom + arc.depth), slope = circleOfBall(RADIUS, h) / (RADIUS - h);
    EXPECT_NEAR(arc.entry, std::asin(rise / slope), 1e-6);
    EXPECT_NEAR(arc.exit, PI - std::asin(rise / slope), 1e-6);
  }
  // Behind the tip nothing is cut: the lowest bands are missing.
  EXPECT_GT(arcs.front().bottom, 0.0);
  // Down, the whole circle near the tip.
  const std::vector<ContactArc> down = stock.contact({0.0, 0.0, -depth}, {0.01, 0.0, -0.01 * rise});
  double span = 0.0;
  for (const ContactArc& arc : down) span += arc.bottom == 0.0 ? arc.exit - arc.entry : 0.0;
  EXPECT_NEAR(span, 2.0 * PI, 1e-5);
}

TEST(Stock, NothingWithoutFeedOrAbove) {
  const Stock stock(box(), endMill(RADIUS));
  EXPECT_TRUE(stock.contact({0.0, 0.0, -2e-3}, {0.0, 0.0, 0.0}).empty());
  EXPECT_TRUE(stock.contact({0.0, 0.0, 1e-3}, {0.01, 0.0, 0.0}).empty());
  EXPECT_TRUE(stock.contact({0.1, 0.0, -1e-3}, {0.01, 0.0, 0.0}).empty());
}

// ---- world

MachineModel mill() {
  MachineModel m = smartmill::mill();
  m.tool->diameter = 2.0 * RADIUS;
  m.stickout = 50e-3;
  m.spindle->load_meter_full_scale = 8.0;
  m.spindle->max_speed = units::radPerSecFromRpm(20000.0);
  m.spindle->acceleration = units::radPerSecFromRpm(20000.0);  // in one second
  MachineAxes axes;
  axes.travel = {{{-0.2, 0.2}, {-0.2, 0.2}, {-0.2, 0.1}}};
  axes.rapid = 0.5;
  axes.acceleration = 5.0;
  axes.home = {-0.1, 0.0, 0.05};
  m.axes = axes;
  smartmill::HammerStation h;
  h.offset = 15e-3;
  h.peak_force = 200.0;
  h.contact_time = 0.5e-3;
  h.gap_at_zero_volt = 250e-6;
  h.gain_volt = h.range_volt = 10.0;
  h.flute_depth = 1e-3;
  h.position["x"] = {-0.1, 0.0, 0.05};
  m.hammer = h;
  m.workpiece = box();
  return m;
}

/// Without the hammer station, which would be in the way of these cuts.
MachineModel millThatCuts() {
  MachineModel m = mill();
  m.hammer.reset();
  return m;
}

/// Runs a DNC program and collects the signals.
class Machine {
 public:
  explicit Machine(const MachineModel& model, const WorldOptions& options = {}) : world(model, options) {}
  void program(const std::string& text) {
    ASSERT_EQ(world.controller().calls().dnc.dncStart(), focas::EW_OK);
    ASSERT_EQ(world.controller().calls().dnc.dncData(text.data(), text.size()), text.size());
    ASSERT_EQ(world.controller().calls().dnc.dncEnd(), focas::EW_OK);
  }
  void run(double time) {
    const auto blocks = static_cast<int>(time * World::SAMPLE_RATE / World::BLOCK);
    for (int k = 0; k < blocks; ++k) {
      World::Block b;
      world.advance(b);
      for (std::size_t i = 0; i < World::BLOCK; ++i) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
          force[axis].push_back(b.force.force[axis][i]);
          sensor[axis].push_back(b.dynamometer.at(i, axis));
        }
        hammer.push_back(b.hammer.at(i, 0));
        tip.push_back(b.vibration.at(i, 0));
        gap.push_back(b.hammer.at(i, 1));
      }
      angle.insert(angle.end(), b.angle.begin(), b.angle.end());
      load.push_back(world.controller().calls().axes.spindleLoad().at(0));
      position.push_back(world.controller().motion().position);
    }
  }
  World world;
  std::array<std::vector<double>, 3> force, sensor;
  std::vector<double> hammer, tip, gap, load;
  std::vector<SpindleAngle> angle;
  std::vector<std::array<double, 3>> position;
};

double mean(const std::vector<double>& v, std::size_t from, std::size_t to) {
  return std::accumulate(v.begin() + static_cast<std::ptrdiff_t>(from),
                         v.begin() + static_cast<std::ptrdiff_t>(to), 0.0) /
         static_cast<double>(to - from);
}

// A slot commanded by NC text gives the closed form's mean forces and the load meter's closed-form voltage.
TEST(World, ASlotByNcTextGivesClosedFormForceAndLoad) {
  const MachineModel model = millThatCuts();
  Machine machine(model);
  // 6000 rpm, 4 teeth, 0.1 mm: 2400 mm/min. From x = -60 mm through the stock.
  machine.program("G90\nG0 X-60\nS6000 M3\nG4 P500\nG1 F6000 Z-1\nG1 F2400 X40\nG1 F6000 Z20\nM5\n");
  // 0.2 s rapid, 0.5 s dwell, 0.55 s down, then 2.5 s of feed: 2.0 .. 3.0 s is well inside.
  machine.run(3.5);
  const auto from = static_cast<std::size_t>(2.0 * World::SAMPLE_RATE);
  const std::size_t to = from + 256 * 50;  // 50 revolutions
  const Engagement slot{0.0, PI, 1e-3, 0.1e-3};
  const MechanisticForce closed(*model.tool, *model.cutting, slot);
  const CuttingForce expected = closed.mean();
  // Error of 256 samples per revolution.
  EXPECT_NEAR(mean(machine.force[0], from, to), expected.fx, 1e-3 * std::abs(expected.fx));
  EXPECT_NEAR(mean(machine.force[1], from, to), expected.fy, 1e-3 * std::abs(expected.fy));
  EXPECT_NEAR(mean(machine.force[2], from, to), expected.fz, 1e-3 * std::abs(expected.fz));
  // Without sensor modes the dynamometer shows the force.
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t i = from; i < from + 1000; ++i)
      ASSERT_NEAR(machine.sensor[axis][i], machine.force[axis][i], 1e-9);
  }
  const double omega = units::radPerSecFromRpm(6000.0);
  const Spindle& s = *model.spindle;
  const double volt = s.load_meter_gain * (expected.torque + s.viscous * omega + s.coulomb) * omega;
  const double percent = mean(machine.load, from / 256, to / 256);
  EXPECT_NEAR(percent, 100.0 * volt / *s.load_meter_full_scale, 2e-3 * percent);
  // No force before the contact.
  EXPECT_EQ(mean(machine.force[0], 0, static_cast<std::size_t>(1.2 * World::SAMPLE_RATE)), 0.0);
}

// A slot with each of two tools of the magazine: mean forces of the closed form of each, and a tool that is
// not in it.
TEST(World, CutsWithTheToolOfM6) {
  MachineModel model = millThatCuts(), small = model;
  small.tool->diameter = 10e-3;
  small.tool->teeth = 2;
  small.tool->helix = 0.3;
  small.cutting->ktc *= 1.5;
  WorldOptions options;
  options.magazine = {{1, model}, {7, small}};
  Machine machine(model, options);
  machine.program(
      "G90 G94 G21 G40 G49 G80\nT7 M6\nG43 H7\nG0 X-60\nS6000 M3 \nM8\nG4 P1000\nG1 F6000 Z-1\nG1 F1200 X0\n"
      "G1 F6000 Z20\nM9\nT1 M6\nG0 X-60 Y30\nS6000 M3\nG4 P1000\nG1 F6000 Z-1\nF2400 X0\n");
  int tools = 0;
  for (const auto& [tool, teeth] : {std::pair(7, 2), std::pair(1, 4)}) {
    while (machine.world.controller().motion().tool != tool || machine.position.back()[2] > -0.9e-3)
      machine.run(0.1);
    machine.run(1.0);
    const std::size_t to = machine.force[0].size(), from = to - 256 * 10;
    const MachineModel& of = tool == 7 ? small : model;
    const CuttingForce expected = MechanisticForce(*of.tool, *of.cutting, {0.0, PI, 1e-3, 0.1e-3}).mean();
    EXPECT_NEAR(mean(machine.force[0], from, to), expected.fx, 2e-3 * std::abs(expected.fx)) << tool;
    EXPECT_NEAR(mean(machine.force[1], from, to), expected.fy, 2e-3 * std::abs(expected.fy)) << tool;
    EXPECT_EQ(of.tool->teeth, teeth);
    ++tools;
  }
  EXPECT_EQ(tools, 2);
  EXPECT_NO_THROW(machine.world.breakTooth(4, 0.0));
  Machine other(model, options);
  other.program("T2 M6\n");
  other.run(0.1);
  const auto alarms = other.world.controller().calls().state.alarmMessages();
  ASSERT_EQ(alarms.size(), 1u);
  EXPECT_NE(alarms[0].text.find("T2 IS NOT IN THE MAGAZINE"), std::string::npos) << alarms[0].text;
}

// Servo Guide's start trigger at a block (Dunwoody section 6.1): it rises at the begin of that block, i.e. at
// the end of the blocks before it, and stays.
TEST(World, TheServoRecordIsTriggeredByItsBlock) {
  WorldOptions options;
  options.servo_trigger = 30;
  options.motor.currents = true;
  World world(millThatCuts(), options);
  const std::string program = "N10 G90 G0 X-60\nN20 S6000 M3\nN25 G4 P500\nN30 G1 F6000 X-50\nN40 X-80\n";
  ASSERT_EQ(world.controller().calls().dnc.dncStart(), focas::EW_OK);
  ASSERT_EQ(world.controller().calls().dnc.dncData(program.data(), program.size()), program.size());
  ASSERT_EQ(world.controller().calls().dnc.dncEnd(), focas::EW_OK);
  double risen = -1.0;
  std::vector<double> before, after;  // currents of X in the dwell, and while it runs at constant speed after
  for (int k = 0; k < 150; ++k) {
    World::Block b;
    world.advance(b);
    ASSERT_EQ(b.motor_current.channels, (std::vector<std::string>{"x", "y", "z", "spindle"}));
    for (std::size_t i = 0; i < b.servo.size(); ++i) {
      const bool triggered = b.servo.at(i, b.servo.channel("trigger")) > 0.5;
      if (triggered && risen < 0.0) {
        risen = b.servo.timeOf(i);
        EXPECT_EQ(b.servo.at(i, b.servo.channel("sequence")), 30.0);
      }
      EXPECT_TRUE(triggered || risen < 0.0);  // never falls again
      if (!triggered) before.push_back(b.servo.at(i, b.servo.channel("current_x")));
      const double since = b.servo.timeOf(i) - risen;
      if (risen > 0.0 && since > 0.04 && since < 0.06)
        after.push_back(b.servo.at(i, b.servo.channel("current_x")));
    }
  }
  // 40 mm at 0.5 m/s and 5 m/s2: 0.18 s; no wait for the spindle; dwell 0.5 s. Samples of 1 ms.
  EXPECT_NEAR(risen, 0.18 + 0.5, 4e-3);
  EXPECT_NEAR(before.back(), 0.0, 1e-9);
  // At 0.1 m/s the drive carries friction, 150 N + 600 N s/m x 0.1 m/s, and the screw's 15 N at most.
  EXPECT_NEAR(mean(after, 0, after.size()) * 628.0, 210.0, 16.0);
}

// The force matches the encoder's angle.
TEST(World, ForceMatchesTheAngle) {
  MachineModel model = millThatCuts();
  model.tool->helix = 0.0;
  Machine machine(model);
  machine.program("G90\nG0 X-60\nS6000 M3\nG4 P500\nG1 F6000 Z-1\nG1 F2400 X40\n");
  machine.run(2.5);
  const MechanisticForce closed(*model.tool, *model.cutting, {0.0, PI, 1e-3, 0.1e-3});
  int compared = 0;
  for (std::size_t k = machine.angle.size() - 40; k < machine.angle.size(); ++k) {
    const SpindleAngle& a = machine.angle[k];
    // The angle is measured half a sample after a sample.
    const auto i = static_cast<std::size_t>(std::floor(a.stamp * World::SAMPLE_RATE));
    const double angle = a.angle - 0.5 * a.speed / World::SAMPLE_RATE;
    // Except where a tooth enters or exits within the sample.
    const double tooth_angle = std::fmod(angle + 2.0 * PI, 0.5 * PI);
    if (tooth_angle < 0.05 || tooth_angle > 0.5 * PI - 0.05) continue;
    const CuttingForce f = closed.at(angle);
    EXPECT_NEAR(machine.force[0][i], f.fx, 2e-3 * 200.0);
    EXPECT_NEAR(machine.force[1][i], f.fy, 2e-3 * 200.0);
    ++compared;
  }
  EXPECT_GT(compared, 10);
}

// The pulses of the tachometer give the encoder's angle and speed.
TEST(World, PulsesMatchTheAngle) {
  WorldOptions options;
  options.pulse_train = true;
  World world(millThatCuts(), options);
  PulseTachometer tachometer({});
  std::vector<MotionState> states(World::BLOCK);
  const double speed = units::radPerSecFromRpm(7321.0);
  double angle = 1.0;
  World::Block block;
  int compared = 0;
  for (int k = 0; k < 60; ++k) {
    for (MotionState& state : states) {
      angle += speed / World::SAMPLE_RATE;
      state.spindle_angle = std::fmod(angle, units::TWO_PI);
      state.spindle_speed = speed;
      state.position = {0.0, 0.0, 0.1};
    }
    world.advance(block, states);
    ASSERT_EQ(block.tachometer.channels, std::vector<std::string>{"tachometer"});
    ASSERT_EQ(block.tachometer.size(), World::BLOCK);
    for (const PulseReading& reading : tachometer.push(block.tachometer)) {
      const SpindleAngle& encoder = block.angle[0];
      const double there = encoder.angle + speed * (reading.angle.stamp - encoder.stamp);
      // Half a sample.
      EXPECT_NEAR(std::remainder(reading.angle.angle - there, units::TWO_PI), 0.0,
                  0.55 * speed / World::SAMPLE_RATE);
      EXPECT_LT(std::abs(reading.angle.speed - speed), 4.0 * reading.speed_std);
      ++compared;
    }
  }
  EXPECT_GT(compared, 65);
}

// In air: four orders of the spindle with amplitudes of 0.01 Pa over the order, and noise of 0.004 Pa.
TEST(World, AMicrophoneHearsTheSpindle) {
  WorldOptions options;
  EXPECT_FALSE(options.microphone);
  options.microphone = true;
  World world(millThatCuts(), options);
  std::vector<MotionState> states(World::BLOCK);
  const double speed = units::radPerSecFromRpm(6000.0);  // 256 samples a revolution
  double angle = 0.0, square = 0.0;
  World::Block block;
  constexpr int BLOCKS = 100;
  for (int k = 0; k < BLOCKS; ++k) {
    for (MotionState& state : states) {
      angle += speed / World::SAMPLE_RATE;
      state.spindle_angle = std::fmod(angle, units::TWO_PI);
      state.spindle_speed = speed;
      state.position = {0.0, 0.0, 0.1};
    }
    world.advance(block, states);
    ASSERT_EQ(block.sound.units, std::vector<std::string>{"Pa"});
    ASSERT_EQ(block.sound.size(), World::BLOCK);
    for (const double pressure : block.sound.samples) square += pressure * pressure / (BLOCKS * World::BLOCK);
  }
  const double expected = 0.5e-4 * (1.0 + 1.0 / 4.0 + 1.0 / 9.0 + 1.0 / 25.0) + 0.004 * 0.004;
  EXPECT_NEAR(square, expected, 0.02 * expected);  // 4 sigma of the noise's contribution: 25,600 samples
}

// An external controller whose spindle stops in the cut from one sample to the next, between two updates of
// the contact.
TEST(World, ASpindleThatStopsInTheCutRaisesAnAlarm) {
  World world(millThatCuts(), {});
  std::vector<MotionState> states(World::BLOCK);
  MotionState state;
  state.position = {-0.06, 0.0, -1e-3};
  state.velocity = {0.04, 0.0, 0.0};
  state.spindle_speed = units::radPerSecFromRpm(6000.0);
  World::Block block;
  double largest = 0.0;
  const auto advance = [&](std::size_t turning) {
    largest = 0.0;
    for (std::size_t i = 0; i < states.size(); ++i) {
      if (i >= turning) state.spindle_speed = 0.0;
      state.position[0] += state.velocity[0] / World::SAMPLE_RATE;
      state.spindle_angle =
          std::fmod(state.spindle_angle + state.spindle_speed / World::SAMPLE_RATE, units::TWO_PI);
      states[i] = state;
    }
    world.advance(block, states);
    for (const double f : block.force.force[1]) largest = std::max(largest, std::abs(f));
  };
  for (int k = 0; k < 200; ++k) advance(World::BLOCK);
  ASSERT_GT(largest, 20.0);
  EXPECT_EQ(world.controller().calls().state.status().alarm, 0);
  advance(101);
  EXPECT_EQ(world.controller().calls().state.status().alarm, 1);
  advance(0);
  EXPECT_EQ(largest, 0.0);
  // It turns again.
  state.spindle_speed = units::radPerSecFromRpm(6000.0);
  advance(World::BLOCK);
  EXPECT_GT(largest, 20.0);
}

TEST(World, CuttingWithTheSpindleAtRestIsRefused) {
  Machine machine(millThatCuts());
  machine.program("G90\nG0 X-60\nG1 F6000 Z-1\nG1 F2400 X40\n");
  machine.run(2.0);
  ASSERT_EQ(machine.world.controller().calls().state.status().alarm, 1);
  EXPECT_NE(machine.world.controller().calls().state.alarmMessages().at(0).text.find("SPINDLE AT REST"),
            std::string::npos);
  // It stopped at the contact with the stock, not 90 mm farther.
  EXPECT_LT(machine.position.back()[0], -50e-3 - RADIUS + 5e-3);
}

// A slot that is milled again finds no material, one in a new workpiece the same force.
TEST(World, ANewWorkpieceIsUncut) {
  const std::string slot = "G90\nG0 X-60\nS6000 M3\nG4 P500\nG0 Z-1\nG1 F2400 X40\nM5\nG0 Z5\nM30\n";
  Machine machine(millThatCuts());
  const auto largest = [&] {
    const std::size_t begin = machine.force[1].size();
    machine.program(slot);
    machine.run(5.0);
    double force = 0.0;
    for (std::size_t i = begin; i < machine.force[1].size(); ++i)
      force = std::max(force, std::abs(machine.force[1][i]));
    return force;
  };
  const double first = largest();
  EXPECT_GT(first, 100.0);
  EXPECT_LT(largest(), 1e-6 * first);
  machine.world.changeWorkpiece();
  EXPECT_NEAR(largest(), first, 0.02 * first);
  machine.program("S6000 M3\n");
  machine.run(2.0);
  EXPECT_THROW(machine.world.changeWorkpiece(), Error);
}

TEST(World, PlungingIsRefused) {
  Machine machine(millThatCuts());
  machine.program("G90\nG0 X0\nS6000 M3\nG4 P500\nG1 F600 Z-5\n");
  machine.run(7.0);
  ASSERT_EQ(machine.world.controller().calls().state.status().alarm, 1);
  EXPECT_NE(machine.world.controller().calls().state.alarmMessages().at(0).text.find("PLUNGED"),
            std::string::npos);
}

// ---- hammer station

// Force 15 mm above the tip of a rigid tool that rotates about a point 250 mm above it: 235 / 250 of the
// tip's receptance.
TEST(World, AHitMovesTheTipOfARotatingRigidTool) {
  MachineModel model = mill();
  model.tool_tip.x.modes = {{3000.0, 0.03, 1.0 / 30e6, NOT_A_NUMBER, NOT_A_NUMBER, NOT_A_NUMBER}};
  model.hammer->contact_time = 20e-3;  // slow compared with the mode: static deflection
  WorldOptions options;
  options.force_scatter = 0.0;
  Machine machine(model, options);
  machine.run(0.02);
  const double rest = machine.gap.back();
  std::string message;
  // At any angle of the flutes the gap follows from the voltage curve.
  ASSERT_EQ(machine.world.strike("tool", "x", message), World::StrikeAnswer::ok) << message;
  EXPECT_EQ(machine.world.strike("tool", "x", message), World::StrikeAnswer::failed);
  machine.run(0.1);
  EXPECT_NEAR(*std::max_element(machine.hammer.begin(), machine.hammer.end()), 200.0, 0.1);
  const auto gapOf = [&](double volt) { return 250e-6 / (volt / 10.0 + 1.0); };
  const double away = gapOf(*std::min_element(machine.gap.begin(), machine.gap.end())) - gapOf(rest);
  const double expected = 200.0 / 30e6 * 235.0 / 250.0;
  // A half sine this slow excites the mode by half its period over the contact, 0.8 %.
  EXPECT_NEAR(away, expected, 0.01 * expected);
}

// Force and response pass the same anti-aliasing filter: otherwise the spectrum of a 0.4 ms hit above half
// the sample rate, 1 % at 12.8 kHz, would change the receptance by 0.3 % with random phase.
TEST(World, AShortHitGivesTheReceptance) {
  MachineModel model = mill();
  model.stickout = 50e-3;
  model.hammer->offset = 0.0;  // at the tip: the drive-point receptance
  model.hammer->contact_time = 0.4e-3;
  const double unknown = NOT_A_NUMBER;
  model.tool_tip.x.modes = {{1210.0, 0.03, 1.0 / 28e6, unknown, unknown, unknown},
                            {2300.0, 0.02, 1.0 / 60e6, unknown, unknown, unknown}};
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    WorldOptions options;
    options.seed = seed;
    options.substeps = 8;
    Machine machine(model, options);
    std::string message;
    ASSERT_EQ(machine.world.strike("tool", "x", message), World::StrikeAnswer::ok) << message;
    machine.run(0.3);
    for (double f : {300.0, 1210.0, 1240.0, 2300.0, 2350.0}) {
      std::complex<double> force, answer;
      for (std::size_t i = 0; i < machine.hammer.size(); ++i) {
        const std::complex<double> turn =
            std::polar(1.0, -2.0 * PI * f * static_cast<double>(i) / World::SAMPLE_RATE);
        force += machine.hammer[i] * turn;
        answer -= machine.tip[i] * turn;  // the hit comes from the sensor's side
      }
      const std::complex<double> expected = model.tool_tip.x.response(f);
      EXPECT_NEAR(std::abs(answer / force / expected - 1.0), 0.0, 1e-3) << f << " Hz, seed " << seed;
    }
  }
}

TEST(World, ASensorTapActsOnHammerAndDynamometer) {
  WorldOptions options;
  options.operator_delay = 0.5;
  Machine machine(mill(), options);
  std::string message;
  EXPECT_EQ(machine.world.strike("force_sensor", "y", message), World::StrikeAnswer::by_hand) << message;
  machine.run(0.8);
  const auto top = std::max_element(machine.hammer.begin(), machine.hammer.end()) - machine.hammer.begin();
  EXPECT_NEAR(static_cast<double>(top) / World::SAMPLE_RATE, 0.5, 1e-3);
  EXPECT_GT(machine.hammer[static_cast<std::size_t>(top)], 200.0);
  // An ideal sensor measures the force of the hit, in its direction only.
  EXPECT_NEAR(machine.sensor[1][static_cast<std::size_t>(top)], machine.hammer[static_cast<std::size_t>(top)],
              1e-6);
  EXPECT_NEAR(machine.sensor[0][static_cast<std::size_t>(top)], 0.0, 1e-9);
  EXPECT_EQ(machine.world.strike("tool", "z", message), World::StrikeAnswer::failed);
}

TEST(World, LostSamplesAreAJumpOfTheIndex) {
  World world(mill(), {});
  World::Block b;
  world.advance(b);
  EXPECT_EQ(b.hammer.first_index, 0u);
  world.skipSamples(1000);
  world.advance(b);
  EXPECT_EQ(b.hammer.first_index, 1256u);
  EXPECT_EQ(b.dynamometer.first_index, 1256u);
  EXPECT_NEAR(b.hammer.stamp, 1256.0 / World::SAMPLE_RATE, 1e-12);
}

TEST(World, RefusesIncompleteModels) {
  const auto line = [](const MachineModel& model, const WorldOptions& options) -> std::string {
    try {
      World world(model, options);
    } catch (const Error& e) {
      return e.what();
    }
    return "";
  };
  MachineModel m = mill();
  m.spindle.reset();
  EXPECT_NE(line(m, {}).find("spindle is missing"), std::string::npos);
  m = mill();
  m.spindle->load_meter_full_scale.reset();
  EXPECT_NE(line(m, {}).find("load_meter_full_scale_v"), std::string::npos);
  m = mill();
  m.stickout = 10e-3;
  EXPECT_NE(line(m, {}).find("offset_mm"), std::string::npos);
  WorldOptions options;
  options.substeps = 0;
  EXPECT_NE(line(mill(), options).find("substeps"), std::string::npos);
}

}  // namespace
}  // namespace smartmill::sim
