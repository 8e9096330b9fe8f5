#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "plant/beam.h"
#include "plant/draw.h"
#include "plant/elastic_dynamometer.h"
#include "plant/front.h"
#include "plant/machine.h"
#include "plant/oscillator.h"
#include "plant/plate.h"
#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/testing/mill.h"
#include "smartmill_core/testing/shared_data.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::plant {
namespace {

constexpr double RADIUS = 10e-3, STEP = 1e-3;  // [m], [rad]

/// A tool without vibration over some revolutions: chip thickness [m] of each tooth over its angle in the
/// last one.
std::vector<std::vector<double>> chipsOf(const std::vector<double>& offsets, double feed_per_tooth) {
  const std::size_t teeth = offsets.size();
  Front front(RADIUS, teeth, STEP);
  const int turn = static_cast<int>(units::TWO_PI / STEP), turns = 25;
  std::vector<std::vector<double>> chips(teeth);
  for (int i = 0; i < turns * turn; ++i) {
    const double angle = units::TWO_PI * i / turn;
    const Point axis{feed_per_tooth * teeth * angle / units::TWO_PI, 0.0};
    for (std::size_t k = 0; k < teeth; ++k) {
      const double phi = angle + units::TWO_PI * static_cast<double>(k) / teeth, reach = RADIUS + offsets[k];
      const double h = front.pass(k, axis, {axis.x + reach * std::sin(phi), axis.y + reach * std::cos(phi)});
      if (i >= (turns - 1) * turn) chips[k].push_back(std::max(h, 0.0));
    }
  }
  return chips;
}

double largest(const std::vector<double>& values) {
  return *std::max_element(values.begin(), values.end());
}

// The area removed per revolution equals the feed times the width, whatever the share of each tooth.
TEST(Front, TeethTakeAwayWhatTheToolMovesOn) {
  for (const std::vector<double>& offsets : {std::vector<double>{0, 0, 0, 0}, {12e-6, 0, -12e-6, 0}, {0}}) {
    const double feed = 0.06e-3;
    double area = 0.0;
    for (const auto& tooth : chipsOf(offsets, feed)) {
      for (const double h : tooth) area += h * (RADIUS - 0.5 * h) * STEP;
    }
    EXPECT_NEAR(area / (2.0 * RADIUS * feed * offsets.size()), 1.0, 3e-3) << offsets.size() << " teeth";
  }
}

TEST(Front, LongTeethTakeTheShortOnesShare) {
  const double feed = 0.05e-3;
  const auto even = chipsOf({0, 0}, feed), little = chipsOf({10e-6, 0}, feed),
             much = chipsOf({80e-6, 0}, feed);
  EXPECT_NEAR(largest(even[0]), feed, 2e-3 * feed);
  EXPECT_NEAR(largest(little[0]), feed + 10e-6, 2e-3 * feed);
  EXPECT_NEAR(largest(little[1]), feed - 10e-6, 2e-3 * feed);
  EXPECT_NEAR(largest(much[0]), 2.0 * feed, 4e-3 * feed);
  EXPECT_EQ(largest(much[1]), 0.0);
}

TEST(Front, KeepsNoMoreCornersThanAFrontNeeds) {
  Front front(RADIUS, 1, STEP);
  for (int i = 0; i < 200000; ++i) {
    const double phi = STEP * i;
    const Point axis{0.1e-3 * phi / units::TWO_PI, 0.0};
    front.pass(0, axis, {axis.x + RADIUS * std::sin(phi), axis.y + RADIUS * std::cos(phi)});
  }
  EXPECT_LT(front.corners(), 6000u);
}

// A clamped round bar: first bending frequency 1.8751^2 sqrt(E I / (rho A L^4)) / 2 pi, compliance L^3 / 3 E
// I.
TEST(Beam, ClampedBar) {
  ToolInSpindle t;
  t.stickout = 0.1;
  t.shank_diameter = 0.012;
  t.flute_ratio = 1.0;
  t.young = 210e9;
  t.density = 7850.0;
  t.spindle_mass = 1e3;
  t.spindle_inertia = 1e3;
  t.stiffness_across = 1e13;
  t.stiffness_tilting = 1e11;
  t.damping_ratio = 0.02;
  const double d = t.shank_diameter, inertia = units::PI / 64.0 * std::pow(d, 4),
               area = units::PI / 4.0 * d * d;
  const auto modes = tipModes(t, 3e5);
  double compliance = 0.0;
  for (const PointMode& m : modes) compliance += m.compliance;
  EXPECT_NEAR(modes[0].frequency,
              1.87510 * 1.87510 / units::TWO_PI *
                  std::sqrt(t.young * inertia / (t.density * area * std::pow(t.stickout, 4))),
              0.5);
  EXPECT_NEAR(compliance / (std::pow(t.stickout, 3) / (3.0 * t.young * inertia)), 1.0, 1e-3);
}

TEST(PlateSensor, ShowsAForceAtRestAsItIs) {
  Plate p;
  p.mass = 15.0;
  p.size = {0.24, 0.17, 0.07};
  p.stiffness = {3e8, 4e8, 8e8};
  p.springs = {0.1, 0.07, 0.01};
  p.force_point = {0.01, -0.02, 0.03};
  p.damping_ratio = 0.02;
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t a = 0; a < 3; ++a) {
      double sum = 0.0;
      for (const SensorMode& m : modesOf(p)) sum += m.output[c] * m.input[a];
      EXPECT_NEAR(sum, c == a ? 1.0 : 0.0, 1e-9);
    }
  }
}

// At rest the sensor shows the force. A short stiff body on a heavy table: sqrt(k / m) / 2 pi; a beam on a
// heavy plate: a clamped bar.
TEST(ElasticDynamometer, ShowsAForceAtRestAsItIsAndHasTheModesOfItsLimits) {
  ElasticDynamometer d;
  d.beams = {{0.1, 0.05, 0.02, 210e9, 7850.0}, {0.06, 0.1, 0.03, 70e9, 2700.0}};
  d.plate_mass = 14.0;
  d.plate_inertia = 0.05;
  d.stiffness = 8e8;
  d.stiffness_tilting = 1e7;
  d.table_mass = 600.0;
  d.table_stiffness = 1e8;
  const auto staticSum = [](const ElasticDynamometer& on, double height) {
    double sum = 0.0;
    for (const SensorMode& m : modesOf(on, 0, height)) sum += m.output[0] * m.input[0];
    return sum;
  };
  for (const double height : {0.1, 0.05, 0.0}) EXPECT_NEAR(staticSum(d, height), 1.0, 1e-6) << height;

  ElasticDynamometer rigid = d;
  rigid.beams = {{0.001, 0.01, 0.01, 210e9, 7850.0}};
  rigid.table_mass = 1e6;
  rigid.stiffness_tilting = 1e10;
  const auto modes = modesOf(rigid, 1, 0.001);
  const auto main =
      std::max_element(modes.begin(), modes.end(), [](const SensorMode& a, const SensorMode& b) {
        return a.output[1] * a.input[1] < b.output[1] * b.input[1];
      });
  EXPECT_NEAR(main->frequency / (std::sqrt(d.stiffness / d.plate_mass) / units::TWO_PI), 1.0, 1e-4);

  ElasticDynamometer clamped = d;
  clamped.beams.resize(1);
  clamped.plate_mass = clamped.plate_inertia = 1e6;
  const double section = std::sqrt(210e9 / 7850.0 / 12.0) * 0.02;  // sqrt(E I / (rho A)) [m2/s]
  const double bar = 1.87510 * 1.87510 / units::TWO_PI * section / 0.01;
  const auto bars = modesOf(clamped, 0, 0.1);
  EXPECT_TRUE(std::any_of(bars.begin(), bars.end(), [bar](const SensorMode& m) {
    return std::abs(m.frequency / bar - 1.0) < 1e-4;
  })) << bar;
}

TEST(OscillatorTest, AnswersAStepAndAResonantForceAsTheClosedFormsSay) {
  const double frequency = 800.0, damping = 0.03, step = 1e-5, w = units::TWO_PI * frequency;
  Oscillator swings(frequency, damping, step), rings(frequency, damping, step);
  const double wd = w * std::sqrt(1.0 - damping * damping);
  double peak = 0.0;
  swings.step(1.0);  // a ramp of one step; from there a step of 1
  const double value = swings.value(), rate = swings.rate();
  for (int i = 1; i <= 20000; ++i) {
    swings.step(1.0);
    const double t = i * step, decay = std::exp(-damping * w * t);
    const double exact = 1.0 + decay * ((value - 1.0) * std::cos(wd * t) +
                                        (rate + damping * w * (value - 1.0)) / wd * std::sin(wd * t));
    ASSERT_NEAR(swings.value(), exact, 1e-9);
    rings.step(std::sin(w * i * step));
    if (i > 15000) peak = std::max(peak, std::abs(rings.value()));
  }
  EXPECT_NEAR(peak, 1.0 / (2.0 * damping), 0.01);
}

CampaignTest slot(double rpm, double feed, double depth) {
  CampaignTest t;
  t.name = "slot";
  t.kind = TestKind::cut;
  t.sample_rate = 25600.0;
  t.spindle_speed = units::radPerSecFromRpm(rpm);
  t.engagement = Engagement{0.0, units::PI, depth, feed};
  return t;
}

Plant rigidPlant() {
  Plant p;
  p.tool.teeth = 4;
  p.tool.diameter = 20e-3;
  p.tool.helix = units::radFromDeg(30.0);
  p.cutting = {796e6, 168e6, 222e6, 27.7e3, 30.8e3, 1.4e3};
  return p;
}

// Mean forces of a slot (Altintas): Fx = -N a (Krc c / 4 + Kre / pi) and so on; they neglect the true tooth
// path, which contributes about 0.1 %.
TEST(Machine, MeanForcesOfASlot) {
  std::mt19937_64 random(1);
  RunOptions o;
  o.noise = false;
  o.steps = 16;
  const double feed = 0.05e-3, depth = 1e-3;
  const Plant p = rigidPlant();
  const Record r = run(p, slot(3000.0, feed, depth), o, random);
  const std::size_t turn = 512, turns = r.size() / turn;
  const double na = 4.0 * depth;
  const std::vector<double> expected{-na * (p.cutting.krc * feed / 4.0), na * p.cutting.ktc * feed / 4.0,
                                     na * (p.cutting.kac * feed / units::PI + p.cutting.kae / 2.0)};
  const std::vector<std::string> names{"fx", "fy", "fz"};
  for (std::size_t c = 0; c < 3; ++c) {
    double mean = 0.0;
    for (std::size_t i = 0; i < turn * turns; ++i) mean += r.column(names[c])[i];
    mean /= static_cast<double>(turn * turns);
    const double edge = c == 0   ? -na * p.cutting.kre / units::PI
                        : c == 1 ? na * p.cutting.kte / units::PI
                                 : 0.0;
    EXPECT_NEAR(mean / (expected[c] + edge), 1.0, 4e-3) << names[c];
  }
}

// The same for a bull-nose mill: integrals over its quarter-circle edge in closed form.
TEST(Machine, MeanForcesOfABullNoseInASlot) {
  std::mt19937_64 random(1);
  RunOptions o;
  o.noise = false;
  o.steps = 16;
  const double feed = 0.05e-3, depth = 2e-3, corner = 1.5e-3, straight = depth - corner, pi = units::PI;
  Plant p = rigidPlant();
  p.effects.push_back(effectEntry("corner_radius", {{"corner_radius_mm", 1.5}}));
  const Record r = run(p, slot(3000.0, feed, depth), o, random);
  const CuttingCoefficients& k = p.cutting;
  const double upright = corner * pi / 4.0 + straight, leaning = corner / 2.0;
  const double chip_across = k.krc * upright - k.kac * leaning,
               chip_along = k.krc * leaning + k.kac * upright;
  const double edge_across = k.kre * depth - k.kae * corner, edge_along = k.kre * corner + k.kae * depth;
  const double edge_tangential = k.kte * (corner * pi / 2.0 + straight);
  const std::vector<double> due{-4.0 * (chip_across * feed / 4.0 + edge_across / pi),
                                4.0 * (k.ktc * depth * feed / 4.0 + edge_tangential / pi),
                                4.0 * (chip_along * feed / pi + edge_along / 2.0)};
  const std::vector<std::string> names{"fx", "fy", "fz"};
  for (std::size_t c = 0; c < 3; ++c) {
    const std::vector<double>& force = r.column(names[c]);
    const std::size_t whole = 512 * (force.size() / 512);
    const double mean =
        std::accumulate(force.begin(), force.begin() + static_cast<std::ptrdiff_t>(whole), 0.0);
    EXPECT_NEAR(mean / static_cast<double>(whole) / due[c], 1.0, 5e-3) << names[c];
  }
}

// Records of an independent program with the classical chip thickness; the true tooth path differs by 0.2 %
// of a chip at 0.1 mm per tooth. Noise: 1 N, 0.05 um.
TEST(Machine, MeetsRecordsOfAnotherProgram) {
  SMARTMILL_SHARED_DATA(folder, "campaigns/vibrating_none");
  const Campaign campaign = readCampaign(folder);
  const Plant plant = plantOf(readMachineModel(campaign.modelPath()));
  std::mt19937_64 random(1);
  for (const CampaignTest& test : campaign.tests) {
    if (test.kind != TestKind::cut) continue;
    const Record record = readRecord(campaign, test);
    RunOptions o;
    o.noise = false;
    o.show_tip = true;
    o.phase = record.column("spindle_angle").front();
    const Record own = run(plant, test, o, random);
    ASSERT_EQ(own.size(), record.size());
    for (const char* name : {"fx", "fy", "fz", "tool_x", "tool_y"}) {
      const double noise = name[0] == 'f' ? 1.0 : 0.05e-6;
      double squares = 0.0;
      for (std::size_t i = 0; i < own.size(); ++i)
        squares += std::pow((record.column(name)[i] - own.column(name)[i]) / noise, 2);
      EXPECT_LT(std::sqrt(squares / own.size()), 1.7) << test.name << " " << name;
    }
  }
}

/// [1] RMS difference of the twin in a column over the RMS of the record, in its second half.
double differenceOfTwin(const MachineModel& model, const CampaignTest& test, const Record& machine,
                        const char* name) {
  sim::SimulationOptions options;
  options.noise = false;
  options.substeps = 8;
  const Record twin = sim::simulateTest(model, test, machine, options);
  double squares = 0.0, size = 0.0;
  for (std::size_t i = twin.size() / 2; i < twin.size(); ++i) {
    squares += std::pow(twin.column(name)[i] - machine.column(name)[i], 2);
    size += std::pow(machine.column(name)[i], 2);
  }
  return std::sqrt(squares / size);
}

// Weight of the true tooth path in the twin, from the rule of formats.md (0) to the true path (1): a slot
// with large vibration per rotation angle.
TEST(Machine, LeavesTheSurfaceOfTheTeethsPath) {
  MachineModel model;
  model.tool = rigidPlant().tool;
  model.cutting = rigidPlant().cutting;
  model.tool_tip.x.modes = {{1100.0, 0.03, 1.0 / 25e6}};
  model.tool_tip.y.modes = {{900.0, 0.04, 1.0 / 30e6}};
  const CampaignTest test = slot(1200.0, 0.2e-3, 1e-3);
  std::mt19937_64 random(1);
  RunOptions o;
  o.noise = false;
  o.steps = 8;
  o.show_tip = true;
  o.slice = 0.02e-3;
  const Record machine = run(plantOf(model), test, o, random);
  const auto difference = [&](double share, const char* name) {
    model.effects = {effectEntry("empirical:tooth_path", {{"share", share}})};
    return differenceOfTwin(model, test, machine, name);
  };
  for (const char* name : {"fx", "fy", "tool_x", "tool_y"}) {
    const double by_rule = difference(0.0, name), half = difference(0.5, name),
                 by_path = difference(1.0, name);
    EXPECT_LT(by_path, 0.2 * by_rule) << name << " " << by_rule;
    EXPECT_LT(by_path, 0.005) << name;
    EXPECT_NEAR(half, 0.5 * by_rule, 0.15 * by_rule) << name;
  }
}

// A tool whose modes differ in x and y, so that the direction of the feed matters. The plant turns its axes,
// the twin its arcs.
TEST(Machine, FeedsInAnyDirectionAsTheTwinDoes) {
  MachineModel model;
  model.tool = rigidPlant().tool;
  model.cutting = rigidPlant().cutting;
  model.tool_tip.x.modes = {{1100.0, 0.03, 1.0 / 25e6}};
  model.tool_tip.y.modes = {{900.0, 0.04, 1.0 / 40e6}};
  model.effects = {effectEntry("empirical:tooth_path", {{"share", 1.0}})};
  std::mt19937_64 random(1);
  RunOptions o;
  o.noise = false;
  o.steps = 8;
  o.show_tip = true;
  o.slice = 0.02e-3;
  for (const double direction : {120.0, -75.0}) {
    CampaignTest test = slot(3000.0, 0.1e-3, 1e-3);
    test.engagement->exit = 0.5 * units::PI;  // up-milling
    test.feed_direction = units::radFromDeg(direction);
    const Record machine = run(plantOf(model), test, o, random);
    CampaignTest along_x = test;
    along_x.feed_direction = 0.0;
    for (const char* name : {"fx", "fy", "tool_x", "tool_y"}) {
      EXPECT_LT(differenceOfTwin(model, test, machine, name), 0.01) << name << " " << direction;
      EXPECT_GT(differenceOfTwin(model, along_x, machine, name), 0.5) << name << " " << direction;
    }
  }
}

// The plant has its acceleration in closed form, the twin derives it from the recorded position.
TEST(Machine, MovesAMassAsTheTwinDoes) {
  MachineModel model;
  model.tool = rigidPlant().tool;
  model.cutting = rigidPlant().cutting;
  for (ModalModel& axis : model.force_sensor.axis) {
    axis.modes = {{1200.0, 0.03, 0.9}};
    axis.direct = 0.1;
  }
  model.effects = {effectEntry("axis_inertia", {{"mass_kg", 25.0}}, {{"axis", "y"}})};
  CampaignTest test;
  test.name = "move";
  test.kind = TestKind::move;
  test.sample_rate = 10000.0;
  std::mt19937_64 random(1);
  RunOptions options;
  options.noise = false;
  const Record plant = run(plantOf(model), test, options, random);
  sim::SimulationOptions quiet;
  quiet.noise = false;
  const Record twin = sim::simulateTest(model, test, plant, quiet);
  double squares = 0.0, difference = 0.0;
  for (std::size_t i = 0; i < plant.size(); ++i) {
    squares += std::pow(plant.column("fy")[i], 2);
    difference += std::pow(plant.column("fy")[i] - twin.column("fy")[i], 2);
  }
  EXPECT_GT(std::sqrt(squares / static_cast<double>(plant.size())), 20.0);  // [N]
  EXPECT_LT(std::sqrt(difference / squares), 0.01);
  for (const char* still : {"fx", "fz"}) EXPECT_NEAR(plant.column(still)[4000], 0.0, 1e-9);
}

// Each effect of the plant's own implementation acts in at least one of these tests.
TEST(Machine, HasEveryEffectOfTheCatalogue) {
  MachineModel model;
  model.tool = rigidPlant().tool;
  model.cutting = rigidPlant().cutting;
  model.spindle = mill().spindle;
  model.tool_tip.x.modes = {{1100.0, 0.03, 1.0 / 25e6}};
  for (ModalModel& axis : model.force_sensor.axis) {
    axis.modes = {{1000.0, 0.03, 0.9}};
    axis.direct = 0.1;
  }
  CampaignTest cut = slot(3000.0, 0.1e-3, 2e-3), move;  // slow enough for Stribeck friction
  cut.cut_time_before = 60.0;
  cut.start_time = 100.0;
  move.kind = TestKind::move;
  move.sample_rate = 10000.0;
  RunOptions options;
  options.noise = false;
  options.steps = 2;
  options.slice = 0.5e-3;
  options.phase = 0.3;
  const auto runBoth = [&](const std::vector<EffectEntry>& effects) {
    std::vector<Record> records;
    for (const CampaignTest& test : {cut, move}) {
      std::mt19937_64 random(1);
      model.effects = effects;
      records.push_back(run(plantOf(model), test, options, random));
    }
    return records;
  };
  const std::vector<Record> without = runBoth({});
  std::mt19937_64 random(2);
  for (const EffectKind& kind : effectCatalogue()) {
    EffectEntry entry = drawEffect(kind.name, model, random);
    if (kind.name == "saturation") entry.numbers["limit_n"] = 100.0;
    const std::vector<Record> with = runBoth({entry});
    double difference = 0.0;
    for (std::size_t t = 0; t < with.size(); ++t) {
      for (const std::string& name : with[t].names) {
        const double unit = name == "load_meter" ? 1e-3 : 1.0;
        for (std::size_t i = 0; i < with[t].size(); ++i)
          difference =
              std::max(difference, std::abs(with[t].column(name)[i] - without[t].column(name)[i]) / unit);
      }
    }
    EXPECT_GT(difference, 0.5) << kind.name;
  }
}

// Rigid: the force at each path is that of uniform work times the factor there.
TEST(Machine, HardnessScalesTheForceAlongTheFeed) {
  Plant plant = rigidPlant();
  CampaignTest cut = slot(3000.0, 0.1e-3, 2e-3);
  cut.engage_time = 0.0;
  RunOptions options;
  options.noise = false;
  options.steps = 2;
  options.slice = 0.5e-3;
  options.phase = 0.3;
  const auto fx = [&] {
    std::mt19937_64 random(1);
    return run(plant, cut, options, random).column("fx");
  };
  const std::vector<double> uniform = fx();
  const double feed = 0.1e-3 * plant.tool.teeth * 50.0;  // [m/s]
  for (const std::string kind : {"hard_spot", "hardness_wave", "hardness_slope"}) {
    plant.outside = Outside{kind, "", 0.3, 0.8e-3, 0.5e-3};
    const std::vector<double> hard = fx();
    for (std::size_t i = 500; i < hard.size(); i += 97) {
      const double x = feed * static_cast<double>(i) / cut.sample_rate;
      const double off = (x - 0.8e-3) / 0.5e-3;
      const double factor = kind == "hard_spot"       ? 1.0 + 0.3 * std::exp(-0.5 * off * off)
                            : kind == "hardness_wave" ? 1.0 + 0.3 * std::sin(units::TWO_PI * off)
                                                      : std::exp(300.0 * x);
      EXPECT_NEAR(hard[i], factor * uniform[i], 1e-6 * std::abs(hard[i]) + 1e-6) << kind << " " << i;
    }
  }
}

// Air cut without noise: the channel shows its zero.
TEST(Machine, ZeroOfAChannelFollowsTheMachinesTime) {
  Plant plant = rigidPlant();
  CampaignTest air = slot(3000.0, 0.1e-3, 2e-3);
  air.kind = TestKind::air;
  air.engagement.reset();
  RunOptions options;
  options.noise = false;
  const auto fy = [&](double start, int seed) {
    air.start_time = start;
    std::mt19937_64 random(seed);
    return run(plant, air, options, random).column("fy");
  };
  const double end = 99.0 / air.sample_rate;  // [s] of the sample compared
  plant.outside = Outside{"zero_drift", "fy", 3.0, 0.0, 0.0};
  EXPECT_NEAR(fy(120.0, 1)[99], 3.0 / 60.0 * (120.0 + end), 1e-9);
  plant.outside = Outside{"zero_approach", "fy", 8.0, 100.0, 0.0};
  EXPECT_NEAR(fy(100.0, 1)[99], 8.0 * (1.0 - std::exp(-1.0 - end / 100.0)), 1e-9);
  plant.outside = Outside{"zero_step", "fy", -5.0, 110.0, 0.0};
  EXPECT_NEAR(fy(100.0, 1)[99], 0.0, 1e-9);
  EXPECT_NEAR(fy(120.0, 1)[99], -5.0, 1e-9);
  plant.outside = Outside{"zero_of_record", "fy", 5.0, 0.0, 0.0};
  const std::vector<double> one = fy(100.0, 1), other = fy(100.0, 2);
  EXPECT_NEAR(one[0], one[99], 1e-9);
  EXPECT_GT(std::abs(one[0] - other[0]), 0.1);
}

TEST(Draw, TheSameCaseGivesTheSameRecordsAndAnotherRunOthers) {
  const std::vector<Case> cases = drawCases({1, 0, 0, 0, 0}, {"runout"}, 5);
  ASSERT_EQ(cases.size(), 1u);
  Drawn drawn = draw(cases[0]);
  ASSERT_EQ(drawn.plant.effects.size(), 1u);
  EXPECT_TRUE(drawn.nominal.effects.empty());
  drawn.campaign.tests.erase(drawn.campaign.tests.begin() + 2, drawn.campaign.tests.end());  // two air cuts
  const TemporaryFolder folder;
  const auto fx = [&](const std::string& name, bool second) {
    writeCampaignOf(drawn, runCampaign(drawn, cases[0], second), folder.file(name));
    const Campaign c = readCampaign(folder.file(name));
    return readRecord(c, c.tests[0]).column("fx");
  };
  const std::vector<double> first = fx("a", false);
  EXPECT_EQ(first, fx("b", false));
  EXPECT_NE(first, fx("c", true));
}

}  // namespace
}  // namespace smartmill::plant
