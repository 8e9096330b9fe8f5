#include "smartmill_sim/twin/twin.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/testing/mill.h"
#include "smartmill_core/testing/shared_data.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/effects/effect_set.h"
#include "smartmill_sim/twin/cut_traces.h"
#include "smartmill_sim/twin/spindle_drive.h"

namespace smartmill::sim {
namespace {

CampaignTest slot() {
  CampaignTest test;
  test.name = "slot";
  test.sample_rate = 25600.0;
  test.spindle_speed = units::radPerSecFromRpm(6000.0);
  test.engagement = Engagement{0.0, units::PI, 2e-3, 6e-5};
  return test;
}

// First order: 63.2 % of a step after 1 / (2 pi f).
TEST(SpindleDrive, loadMeterIsFirstOrder) {
  const Spindle spindle = *mill().spindle;
  const double step = 1e-5, speed = 500.0;
  SpindleDrive drive(spindle, step);
  drive.reset(speed);
  const double air = spindle.load_meter_gain * (4e-4 * speed + 0.05) * speed;
  double voltage = 0.0;
  const int steps = static_cast<int>(std::lround(1.0 / (units::TWO_PI * 7.0) / step));
  for (int i = 0; i < steps; ++i) voltage = drive.step(2.0, speed);
  EXPECT_NEAR((voltage - air) / (spindle.load_meter_gain * 2.0 * speed), 1.0 - std::exp(-1.0), 1e-3);
  EXPECT_NEAR(drive.rounded(0.10007), 0.1002, 1e-9);
}

TEST(SpindleDrive, frictionIsZeroBelowItsSpeed) {
  Spindle spindle = *mill().spindle;
  spindle.friction_zero_below = 209.0;
  const SpindleDrive drive(spindle, 1e-5);
  EXPECT_EQ(drive.friction(200.0), 0.0);
  EXPECT_NEAR(drive.friction(1000.0), 0.45, 1e-12);
}

// Complete revolutions of a slot: mean forces and torque in closed form (eq. 3.19).
TEST(Twin, meanForceOfASlotIsTheClosedForm) {
  SimulationOptions options;
  options.noise = false;
  const Record record = simulateTest(mill(), slot(), 0.5, options);
  const double n = 4, a = 2e-3, c = 6e-5;
  EXPECT_NEAR(mean(record.column("fx")), -n * a * c * 300e6 / 4.0 - n * a * 25e3 / units::PI, 0.5);
  EXPECT_NEAR(mean(record.column("fy")), n * a * c * 800e6 / 4.0 + n * a * 20e3 / units::PI, 0.5);
  EXPECT_NEAR(mean(record.column("fz")), n * a * c * 200e6 / units::PI + n * a * 3e3 / 2.0, 0.5);
  const double torque = 10e-3 * n * a * (800e6 * c / units::PI + 20e3 / 2.0);
  const double speed = slot().spindle_speed;
  const double steady = 4e-4 * (torque + 4e-4 * speed + 0.05) * speed;
  EXPECT_NEAR(record.column("load_meter").back() / steady, 1.0,
              2e-3);  // tooth passing ripple through 7 Hz
}

TEST(Twin, noForceBeforeTheEngagement) {
  CampaignTest test = slot();
  test.engage_time = 0.02;
  SimulationOptions options;
  options.noise = false;
  const Record record = simulateTest(mill(), test, 0.05, options);
  for (std::size_t i = 0; i < 512; ++i) ASSERT_EQ(record.column("fy")[i], 0.0);
  EXPECT_GT(std::abs(record.column("fy")[530]), 1.0);
}

// A smooth hit; the responding channel identifies the target.
Record tapOf(const std::string& answering) {
  Record record;
  const std::size_t samples = 4096, hit = 200;
  for (std::size_t i = 0; i < samples; ++i) record.time.push_back(static_cast<double>(i) / 25600.0);
  for (const char* c : {"hammer", "fx", "tool_x", "acceleration"}) {
    std::vector<double>& column = record.add(c);
    column.assign(samples, 0.0);
    for (std::size_t i = 0; i < samples; ++i) column[i] = i % 2 == 0 ? 1e-9 : -1e-9;  // noise, not zero
    if (c == answering) column[hit + 5] = 1.0;
  }
  for (std::size_t i = 0; i < 20; ++i)
    record.add("hammer")[hit + i] = 100.0 * std::pow(std::sin(units::PI * static_cast<double>(i) / 20.0), 2);
  return record;
}

// Columns to be simulated.
Record blank() {
  Record record;
  for (int i = 0; i < 2560; ++i) record.time.push_back(i / 25600.0);
  for (const char* c : {"fx", "fy", "fz", "tool_x", "tool_y"}) record.add(c).assign(record.time.size(), 0.0);
  return record;
}

MachineModel flexibleMill() {
  MachineModel model = mill();
  model.tool_tip.x.modes = {{1210.0, 0.031, 1.0 / 28e6}};
  model.tool_tip.y.modes = {{1180.0, 0.029, 1.0 / 31e6}};
  model.force_sensor.axis[0].modes = {{930.0, 0.02, 0.9}};
  return model;
}

// The cutting force moves the workpiece against the tool, so that the chip depends on the sum of both
// receptances; the tip moves by its own.
TEST(Twin, workpieceVibratesAgainstTheTool) {
  MachineModel tool = flexibleMill(), part = flexibleMill(), both = flexibleMill();
  part.tool_tip = {};
  part.workpiece_modes = {{0.0, tool.tool_tip.x, tool.tool_tip.y}};
  for (ModalModel* axis : {&both.tool_tip.x, &both.tool_tip.y}) axis->modes.front().gain *= 0.25;
  both.workpiece_modes = {{0.0, both.tool_tip.x, both.tool_tip.y}};
  for (ModalModel* axis : {&both.workpiece_modes[0].x, &both.workpiece_modes[0].y})
    axis->modes.front().gain *= 3.0;
  SimulationOptions options;
  options.noise = false;
  options.phase = 1.0;
  const Record of_tool = simulateTest(tool, slot(), blank(), options),
               of_part = simulateTest(part, slot(), blank(), options),
               of_both = simulateTest(both, slot(), blank(), options);
  const std::vector<double>& moved = of_tool.column("tool_x");
  const auto largest = [](const std::vector<double>& values) {
    double most = 0.0;
    for (const double v : values) most = std::max(most, std::abs(v));
    return most;
  };
  const double force = largest(of_tool.column("fx")), most = largest(moved);
  EXPECT_GT(most, 1e-6);
  for (std::size_t i = 0; i < moved.size(); ++i) {
    ASSERT_NEAR(of_part.column("fx")[i], of_tool.column("fx")[i], 1e-9 * force);
    ASSERT_NEAR(of_both.column("fx")[i], of_tool.column("fx")[i], 1e-9 * force);
    ASSERT_NEAR(of_both.column("tool_x")[i], 0.25 * moved[i], 1e-9 * most);
    ASSERT_EQ(of_part.column("tool_x")[i], 0.0);
  }
}

// A cached trace of one model gives identical records for models that differ after the tool, for a rigid tool
// also in coefficients and wear.
TEST(Twin, cachedTracesGiveIdenticalRecords) {
  MachineModel rigid = flexibleMill();
  rigid.tool_tip = {};
  for (const MachineModel& first : {rigid, flexibleMill()}) {
    MachineModel sensor = first, harder = first, worn = first;
    sensor.force_sensor.axis[0].modes.front().frequency *= 1.1;
    harder.cutting->ktc *= 1.2;
    EffectEntry wear;
    wear.name = "tool_wear";
    wear.numbers["edge_growth_per_min"] = 2.0;
    worn.effects = {wear};
    CampaignTest test = slot();
    test.engage_time = 0.01;
    test.cut_time_before = 10.0;
    CutTraces traces(2);
    SimulationOptions alone, held;
    alone.noise = held.noise = false;
    alone.phase = held.phase = 1.0;
    held.traces = &traces;
    for (const MachineModel& model : {first, sensor, harder, worn, first}) {
      const Record a = simulateTest(model, test, blank(), alone),
                   b = simulateTest(model, test, blank(), held);
      for (const char* c : {"fx", "fy", "fz", "tool_x", "tool_y"}) EXPECT_EQ(a.column(c), b.column(c)) << c;
    }
  }
}

// The same with a prescribed motion of the tip: models may differ in coefficients, wear and the tool's modes.
// Damping and geometry belong to the cut and are not shared.
TEST(Twin, cachedSumsOfAGuidedToolGiveIdenticalRecords) {
  CampaignTest test = slot();
  test.engage_time = 0.01;
  test.cut_time_before = 10.0;
  SimulationOptions alone;
  alone.noise = false;
  alone.phase = 1.0;
  const Record measured = simulateTest(flexibleMill(), test, blank(), alone);
  MachineModel harder = flexibleMill(), softer = harder, worn = harder, damped = harder, cornered = harder;
  harder.cutting->ktc *= 1.2;
  softer.tool_tip.x.modes.front().gain *= 2.0;
  worn.effects = {effectEntry("tool_wear", {{"edge_growth_per_min", 2.0}})};
  damped.effects = {effectEntry("process_damping", {{"coefficient_n_per_mm", 20.0}})};
  cornered.effects = {effectEntry("corner_radius", {{"corner_radius_mm", 1.0}})};
  CutTraces traces(8);
  alone.guided = true;
  SimulationOptions held = alone;
  held.traces = &traces;
  for (const MachineModel& model : {flexibleMill(), harder, softer, worn, damped, cornered, harder}) {
    const Record a = simulateTest(model, test, measured, alone),
                 b = simulateTest(model, test, measured, held);
    for (const char* c : {"fx", "fy", "fz", "tool_x", "tool_y"}) EXPECT_EQ(a.column(c), b.column(c)) << c;
  }
  EXPECT_EQ(valuesOfTrace(flexibleMill(), TestKind::cut, true), valuesOfTrace(worn, TestKind::cut, true));
  EXPECT_EQ(valuesOfTrace(harder, TestKind::cut, true), valuesOfTrace(softer, TestKind::cut, true));
  EXPECT_NE(valuesOfTrace(harder, TestKind::cut, true), valuesOfTrace(damped, TestKind::cut, true));
  EXPECT_NE(valuesOfTrace(harder, TestKind::cut, true), valuesOfTrace(cornered, TestKind::cut, true));
}

// A channel simulated alone equals the same channel of the whole record; its key changes if and only if the
// channel does.
TEST(Twin, singleChannelsEqualThoseOfTheRecord) {
  CampaignTest test = slot();
  test.engage_time = 0.01;
  const MachineModel first = flexibleMill();
  MachineModel sensor = first, delayed = first, mixed = first;
  sensor.force_sensor.axis[0].modes.front().frequency *= 1.1;
  delayed.effects = {effectEntry("channel_delay", {{"delay_us", 30.0}}, {{"channel", "fy"}})};
  mixed.effects = {effectEntry("cross_talk", {{"xy", 0.1}})};
  EXPECT_FALSE(channelsAreIndependent(mixed));
  mixed.effects = {effectEntry("empirical:resonance",
                               {{"frequency_hz", 870.0}, {"damping_ratio", 0.03}, {"gain", 0.3}},
                               {{"channel", "fz"}, {"from", "fx"}})};
  EXPECT_FALSE(channelsAreIndependent(mixed));
  SimulationOptions options;
  options.noise = false;
  options.phase = 1.0;
  const std::vector<std::string> channels{"fx", "fy", "fz", "tool_x", "tool_y"};
  const Record nominal = simulateTest(first, test, blank(), options);
  for (const MachineModel& model : {sensor, delayed}) {
    ASSERT_TRUE(channelsAreIndependent(model));
    options.channels = nullptr;
    const Record all = simulateTest(model, test, blank(), options);
    for (const std::string& c : channels) {
      const std::vector<std::string> only{c};
      options.channels = &only;
      const Record one = simulateTest(model, test, blank(), options);
      EXPECT_EQ(one.column(c), all.column(c)) << c;
      EXPECT_FALSE(one.has(c == "fx" ? "fy" : "fx"));
      const bool same_values =
          valuesOfChannel(model, test.kind, channelOf(c)) == valuesOfChannel(first, test.kind, channelOf(c));
      EXPECT_EQ(same_values, all.column(c) == nominal.column(c)) << c;
    }
  }
}

// With the measured displacement the forces are independent of the modelled structure, which changes the
// displacement alone; with the true structure it equals the measured one.
TEST(Twin, guidedByDisplacementForcesDoNotDependOnTheStructure) {
  CampaignTest test = slot();
  test.engage_time = 0.01;
  SimulationOptions options;
  options.noise = false;
  options.phase = 1.0;
  options.substeps = 8;
  const Record measured = simulateTest(flexibleMill(), test, blank(), options);
  options.guided = true;
  MachineModel softer = flexibleMill();
  softer.tool_tip.x.modes.front().gain *= 2.0;
  const Record same = simulateTest(flexibleMill(), test, measured, options);
  const Record soft = simulateTest(softer, test, measured, options);
  double error = 0.0, force = 0.0, shift = 0.0, displacement = 0.0;
  for (std::size_t i = 0; i < measured.size(); ++i) {
    force += std::pow(measured.column("fx")[i], 2);
    error += std::pow(measured.column("fx")[i] - same.column("fx")[i], 2);
    displacement += std::pow(measured.column("tool_x")[i], 2);
    shift += std::pow(measured.column("tool_x")[i] - same.column("tool_x")[i], 2);
    ASSERT_EQ(soft.column("fx")[i], same.column("fx")[i]);
    ASSERT_NEAR(soft.column("tool_x")[i], 2.0 * same.column("tool_x")[i], 1e-12);
  }
  EXPECT_LT(std::sqrt(error / force), 0.01);
  EXPECT_LT(std::sqrt(shift / displacement), 0.01);
}

// Without these channels the motion of the tip follows from the measured force through sensor and structure:
// a true model reproduces the record, a wrong one stays finite where a free simulation would be unstable.
TEST(Twin, guidedByForcesAWrongModelStaysFinite) {
  CampaignTest test = slot();
  test.engage_time = 0.01;
  MachineModel truth = flexibleMill();
  truth.force_sensor.axis[0].modes = {{930.0, 0.03, 0.9}};
  truth.force_sensor.axis[1].modes = {{1080.0, 0.03, 0.9}};
  truth.force_sensor.axis[0].direct = truth.force_sensor.axis[1].direct = 0.1;
  truth.force_sensor.noise_rms = Axes3{{1.0, 1.0, 1.0}};
  SimulationOptions options;
  options.phase = 1.0;
  options.substeps = 8;
  Record forces;
  forces.time = blank().time;
  for (const char* c : {"spindle_angle", "fx", "fy", "fz"}) forces.add(c).assign(forces.time.size(), 0.0);
  const Record measured = simulateTest(truth, test, forces, options);
  options.noise = false;
  const auto residual = [&](const MachineModel& model, bool guided) {
    options.guided = guided;
    const Record simulated = simulateTest(model, test, measured, options);
    double squares = 0.0;
    for (const char* c : {"fx", "fy"}) {
      for (std::size_t i = 0; i < measured.size(); ++i)
        squares += std::pow(simulated.column(c)[i] - measured.column(c)[i], 2);
    }
    return std::sqrt(squares / (2.0 * static_cast<double>(measured.size())));  // [N]
  };
  EXPECT_LT(residual(truth, false), 1.05);
  EXPECT_LT(residual(truth, true), 1.5);
  MachineModel wrong = truth;
  wrong.cutting->ktc *= 4.0;
  wrong.cutting->krc *= 4.0;
  double size = 0.0;
  for (const double f : measured.column("fx")) size = std::max(size, std::abs(f));
  EXPECT_GT(residual(wrong, false), 2.0 * residual(wrong, true));
  EXPECT_LT(residual(wrong, true), 4.0 * size);
}

// A record from the middle of a cut begins in the steady state: it is periodic from its first sample on and
// equals the final state of a record that includes the engagement.
TEST(Twin, aRecordOfARunningCutIsSteady) {
  MachineModel model = mill();
  model.tool_tip.x.modes = {{1210.0, 0.031, 1.0 / 28e6}};
  model.tool_tip.y.modes = {{1180.0, 0.029, 1.0 / 31e6}};
  model.force_sensor.axis[0].modes = {{930.0, 0.02, 0.9}};
  model.force_sensor.axis[1].modes = {{1080.0, 0.025, 0.9}};
  SimulationOptions options;
  options.noise = false;
  CampaignTest whole = slot(), part = slot();
  whole.engagement->axial_depth = part.engagement->axial_depth = 1e-3;
  whole.engage_time = 0.0;
  part.running_before = 0.4;
  // 64 samples a tooth: 25600 / (4 * 100 Hz).
  options.phase = 0.0;
  const Record settled = simulateTest(model, whole, 0.6, options),
               running = simulateTest(model, part, 0.1, options);
  for (const char* channel : {"fx", "fy", "load_meter"}) {
    const std::vector<double>&a = settled.column(channel), &b = running.column(channel);
    double largest = 0.0;
    for (const double v : a) largest = std::max(largest, std::abs(v));
    // 50 revolutions of 256 samples lie between the two. The transient of the load meter has decayed to a
    // hundredth: four time constants since the full depth.
    for (std::size_t i = 0; i < b.size(); ++i)
      ASSERT_NEAR(b[i], a[i + 50 * 256], 2e-3 * largest) << channel << i;
  }
}

// The mean of a sine over an interval is sin(x) / x of it, x = pi f / rate.
TEST(Twin, meanSamplesAreMeansOverTheirIntervals) {
  MachineModel model = mill();
  model.effects = {effectEntry("unbalance", {{"mass_eccentricity_g_mm", 100.0}, {"angle_deg", 0.0}})};
  CampaignTest air = slot();
  air.kind = TestKind::air;
  air.engagement.reset();
  air.sample_rate = 2000.0;  // twenty samples per revolution
  SimulationOptions options;
  options.noise = false;
  options.phase = 0.0;
  const Record instant = simulateTest(model, air, 0.2, options);
  model.force_sensor.mean_samples = true;
  const Record mean = simulateTest(model, air, 0.2, options);
  const double x = units::PI * 100.0 / 2000.0, expected = std::sin(x) / x;
  // Error of the order of x^4 / 20.
  EXPECT_NEAR(rms(mean.column("fx")) / rms(instant.column("fx")), expected, 5e-5);
}

TEST(Twin, tapActsOnTheRespondingTarget) {
  MachineModel model = mill();
  model.tool_tip.x.modes = {{700.0, 0.03, 1.0 / 28e6}};
  CampaignTest test = slot();
  test.kind = TestKind::tap;
  test.spindle_speed = 0.0;
  test.engagement.reset();
  test.direction = "x";
  SimulationOptions options;
  options.noise = false;
  options.substeps = 8;
  const Record sensor = simulateTest(model, test, tapOf("fx"), options);
  EXPECT_NEAR(sensor.column("fx")[210], 100.0, 1e-6);
  EXPECT_EQ(sensor.column("tool_x")[230], 0.0);
  const Record tip = simulateTest(model, test, tapOf("tool_x"), options);
  EXPECT_EQ(tip.column("fx")[210], 0.0);
  // Impulse response of the mode after the hit: x = I / (m w_d) exp(-z w t) sin(w_d t), and its second
  // derivative.
  const double impulse = mean(tip.column("hammer")) * static_cast<double>(tip.size()) / 25600.0;
  const double w = units::TWO_PI * 700.0, z = 0.03, wd = w * std::sqrt(1.0 - z * z);
  // A 0.8 ms hit excites the mode by its spectrum at the natural frequency, equally in x and x''.
  const std::vector<double>& x = tip.column("tool_x");
  const std::vector<double>& a = tip.column("acceleration");
  double largest = 0.0;
  for (std::size_t i = 300; i < 1500; ++i) largest = std::max(largest, std::abs(x[i]));
  EXPECT_LT(largest, impulse * w * w / 28e6 / wd);
  EXPECT_GT(largest, 0.3 * impulse * w * w / 28e6 / wd);
  for (std::size_t i = 300; i < 1500; i += 37) {
    const double rate = (x[i + 1] - x[i - 1]) * 0.5 * 25600.0;  // second order: 0.5 % at 700 Hz
    EXPECT_NEAR(a[i], -w * w * x[i] - 2.0 * z * w * rate, 1e-3 * w * w * largest) << i;
  }
}

TEST(Twin, refusesIncompleteModels) {
  MachineModel model = mill();
  model.effects.push_back({});
  EXPECT_THROW(simulateTest(model, slot(), 0.1, {}), Error);
  model = mill();
  model.cutting.reset();
  EXPECT_THROW(simulateTest(model, slot(), 0.1, {}), Error);
}

/// Effects of the campaigns that an independent program generated.
std::map<std::string, std::vector<EffectEntry>> hiddenEffects() {
  return {{"none", {}},
          {"runout", {effectEntry("runout", {{"offset_um", 21.08}, {"angle_deg", 261.8}})}},
          {"cross_talk", {effectEntry("cross_talk", {{"xy", 0.0509}, {"yx", 0.0614}, {"zx", -0.0335}})}},
          {"stribeck_friction",
           {effectEntry("stribeck_friction", {{"breakaway_nm", 0.4557}, {"speed_rpm", 2775.2}})}},
          {"tool_wear_and_unbalance",
           {effectEntry("unbalance", {{"mass_eccentricity_g_mm", 11.01}, {"angle_deg", 339.2}}),
            effectEntry("tool_wear", {{"edge_growth_per_min", 0.4194}})}},
          {"vibrating_none", {}},
          {"vibrating_runout", {effectEntry("runout", {{"offset_um", 21.98}, {"angle_deg", 217.9}})}}};
}

/// Residual of a channel with the true model, in units of its noise.
struct Residual {
  double squares = 0.0;
  std::size_t samples = 0;

  void add(const Residual& other) {
    squares += other.squares;
    samples += other.samples;
  }
  double gap() const { return std::sqrt(squares / static_cast<double>(samples)); }
  /// At least 1.05; four standard deviations of the gap of so few samples.
  double limit() const { return std::max(1.05, 1.0 + 4.0 / std::sqrt(2.0 * static_cast<double>(samples))); }
};

Residual residualOf(const Record& measured, const Record& simulated, const std::string& channel, double noise,
                    std::size_t from, std::size_t to) {
  Residual residual;
  const std::vector<double>&m = measured.column(channel), &s = simulated.column(channel);
  for (std::size_t i = from; i < std::min(to, m.size()); ++i) {
    residual.squares += std::pow((m[i] - s[i]) / noise, 2);
    ++residual.samples;
  }
  return residual;
}

/// Noise RMS that the campaigns state: 1 N, 0.22 mV with the rounding, 0.05 um.
const std::map<std::string, double>& statedNoise() {
  static const std::map<std::string, double> NOISE{
      {"fx", 1.0}, {"fy", 1.0}, {"fz", 1.0}, {"load_meter", 2.2e-4}, {"tool_x", 5e-8}, {"tool_y", 5e-8}};
  return NOISE;
}

/// Largest gap of a channel of one test: 1.05, except for one cut near its stability limit. There the
/// difference of two solutions of the same equations persists as the tool's own motion (1131 Hz, multiplier
/// 0.985 per revolution) and grows 15 times in seven revolutions: so does the difference of this twin at 4
/// and at 16 steps per sample (0.15 of the noise), and so does the residual, which is at that frequency and
/// below the noise in the first revolutions. The steps of this twin contribute a tenth of its squares, the
/// rounding of the hidden runout a twentieth; the stated convergence of the other program, 0.04 N, amounts to
/// 0.6 N after this growth; the residual is 0.5 N.
double allowedGap(const std::string& campaign, const CampaignTest& test, const std::string& channel) {
  static const std::map<std::string, double> NEAR_ITS_LIMIT{
      {"fx", 1.13}, {"fy", 1.09}, {"tool_x", 1.07}, {"tool_y", 1.23}};
  if (campaign != "vibrating_runout" || test.name != "slot_4500_deep") return 1.05;
  const auto allowed = NEAR_ITS_LIMIT.find(channel);
  return allowed == NEAR_ITS_LIMIT.end() ? 1.05 : allowed->second;
}

// Campaigns of another program with its exact models and effects: the residual must be its noise on every
// channel of every test, from the first revolutions after the engagement on.
TEST(Twin, residualOfIndependentCampaignsIsTheirNoise) {
  SMARTMILL_SHARED_DATA(folder, "campaigns");
  for (const auto& [name, effects] : hiddenEffects()) {
    const Campaign campaign = readCampaign(folder + "/" + name);
    MachineModel model = readMachineModel(campaign.modelPath());
    model.effects = effects;
    SimulationOptions options;
    options.noise = false;
    std::map<std::string, Residual> whole;
    std::size_t checked = 0;
    for (const CampaignTest& test : campaign.tests) {
      const Record measured = readRecord(campaign, test);
      const Record simulated = simulateTest(model, test, measured, options);
      for (const auto& [channel, noise] : statedNoise()) {
        if (!measured.has(channel)) continue;
        const Residual residual = residualOf(measured, simulated, channel, noise, 0, measured.size());
        whole[channel].add(residual);
        EXPECT_LE(residual.gap(), allowedGap(name, test, channel))
            << name << " " << test.name << " " << channel;
        ++checked;
        if (test.kind != TestKind::cut) continue;
        const auto begin = static_cast<std::size_t>(*test.engage_time * test.sample_rate);
        const double turn = units::TWO_PI / test.spindle_speed * test.sample_rate;
        const Residual first = residualOf(measured, simulated, channel, noise, begin,
                                          begin + static_cast<std::size_t>(2.0 * turn));
        EXPECT_LE(first.gap(), first.limit())
            << name << " " << test.name << " " << channel << ", first revolutions";
      }
    }
    const bool vibrates = !model.tool_tip.x.modes.empty();
    EXPECT_EQ(checked, vibrates ? 21u * 3u + 18u + 12u * 2u : 21u * 3u + 18u) << name;
    for (const auto& [channel, residual] : whole) EXPECT_LE(residual.gap(), 1.02) << name << " " << channel;
  }
}

// Without an effect of the axis motion a move has no force; its axes are inputs, as the spindle angle.
TEST(Twin, aMoveOfTheAxesHasNoForce) {
  CampaignTest test;
  test.name = "move";
  test.kind = TestKind::move;
  test.sample_rate = 1000.0;
  Record recorded;
  for (int i = 0; i < 200; ++i) {
    recorded.time.push_back(i / 1000.0);
    recorded.add("axis_x").push_back(1e-2 * std::sin(0.05 * i));
    for (const char* name : {"fx", "fy", "fz"}) recorded.add(name).push_back(7.0);
    recorded.add("current_x").push_back(1.0);
  }
  SimulationOptions options;
  options.noise = false;
  const Record simulated = simulateTest(mill(4), test, recorded, options);
  EXPECT_EQ(simulated.column("axis_x"), recorded.column("axis_x"));
  for (const char* name : {"fx", "fy", "fz"})
    EXPECT_EQ(simulated.column(name), std::vector<double>(recorded.size(), 0.0)) << name;
  EXPECT_FALSE(simulated.has("current_x"));
  EXPECT_THROW(simulateTest(mill(4), test, 0.1, options), Error);
}

// The result is independent of the integration steps.
TEST(Twin, resultConvergesWithFinerSteps) {
  SMARTMILL_SHARED_DATA(folder, "campaigns/vibrating_runout");
  const Campaign campaign = readCampaign(folder);
  MachineModel model = readMachineModel(campaign.modelPath());
  model.effects = hiddenEffects().at("vibrating_runout");
  for (const CampaignTest& test : campaign.tests) {
    if (test.name != "slot_4500_030" && test.name != "up_4500") continue;
    const Record measured = readRecord(campaign, test);
    std::vector<std::vector<double>> fy;
    for (const int substeps : {3, 4, 11}) {
      SimulationOptions options;
      options.noise = false;
      options.substeps = substeps;
      fy.push_back(simulateTest(model, test, measured, options).column("fy"));
    }
    for (std::size_t k = 0; k < 2; ++k) {
      for (std::size_t i = 0; i < fy[k].size(); ++i) fy[k][i] -= fy[2][i];
    }
    EXPECT_LT(rms(fy[0]), 0.25) << test.name;
    EXPECT_LT(rms(fy[1]), 0.15) << test.name;
  }
}

}  // namespace
}  // namespace smartmill::sim
