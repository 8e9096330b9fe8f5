#include "smartmill_discrepancy/live/live_gap.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/mill.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/twin/cutting_machine.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {
namespace {

constexpr double SIGMA = 2.0;  // [N]

MachineModel mill(bool with_noise = true) {
  MachineModel model = smartmill::mill();
  model.spindle.reset();
  model.force_sensor.axis[0].modes = {{930.0, 0.02, 0.9}};
  model.force_sensor.axis[0].direct = 0.1;
  if (with_noise) model.force_sensor.noise_rms = Axes3{{SIGMA, SIGMA, SIGMA}};
  return model;
}

Stretch slot(const MachineModel& model, std::uint64_t seed) {
  Stretch stretch;
  stretch.stamp = 12.3;
  stretch.test.name = "slot";
  stretch.test.sample_rate = 25600.0;
  stretch.test.spindle_speed = 600.0;
  Engagement engagement;
  engagement.feed_per_tooth = 1e-4;
  engagement.axial_depth = 1e-3;
  engagement.entry = 0.0;
  engagement.exit = units::TWO_PI / 2.0;
  stretch.test.engagement = engagement;
  sim::SimulationOptions options;
  options.seed = seed;
  stretch.record = sim::simulateTest(model, stretch.test, 0.3, options);
  return stretch;
}

// RMS of n samples of white noise over its standard deviation: 1 with deviation 1 / sqrt(2 n).
TEST(LiveGap, isOneForTheTwinsOwnRecord) {
  const MachineModel model = mill();
  double sum2 = 0.0;
  int count = 0;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const Stretch stretch = slot(model, seed);
    const LiveGap gap = liveGap(model, stretch, {});
    const double deviation =
        1.0 / std::sqrt(static_cast<double>(stretch.record.size()));  // half of it judged
    EXPECT_TRUE(gap.model_fits);
    EXPECT_EQ(gap.stamp, 12.3);
    EXPECT_EQ(gap.condition, "slot");
    ASSERT_GE(gap.gap.size(), 3U);
    for (std::size_t k = 0; k < 3; ++k, ++count) {
      EXPECT_NEAR(gap.gap[k], 1.0, 4.5 * deviation) << gap.channels[k];
      sum2 += std::pow((gap.gap[k] - 1.0) / deviation, 2);
    }
  }
  // Chi-square of 90 values over 90: deviation 0.15.
  EXPECT_NEAR(sum2 / count, 1.0, 0.45);
}

// A tone of amplitude a beside noise s: sqrt(1 + a^2 / (2 s^2)).
TEST(LiveGap, risesByAKnownTone) {
  const MachineModel model = mill();
  Stretch stretch = slot(model, 7);
  constexpr double AMPLITUDE = 3.0 * SIGMA;
  Record& record = stretch.record;
  for (std::size_t c = 0; c < record.names.size(); ++c) {
    if (record.names[c] != "fy") continue;
    for (std::size_t i = 0; i < record.size(); ++i)
      record.columns[c][i] += AMPLITUDE * std::sin(units::TWO_PI * 200.0 * record.time[i]);
  }
  const LiveGap gap = liveGap(model, stretch, {});
  EXPECT_FALSE(gap.model_fits);
  const double n = static_cast<double>(stretch.record.size()) / 2.0, expected = std::sqrt(1.0 + 9.0 / 2.0);
  // Variance of the mean of (tone + noise)^2: (2 + 4 a^2 / 2) / n in units of the noise.
  const double deviation = std::sqrt((2.0 + 18.0) / n) / (2.0 * expected);
  EXPECT_NEAR(gap.gap[1], expected, 4.0 * deviation);
  EXPECT_NEAR(gap.gap[0], 1.0, 0.06);
  EXPECT_NEAR(gap.gap[2], 1.0, 0.06);
}

/// A tool that vibrates and a spindle with a load meter.
MachineModel flexibleMill() {
  MachineModel model = mill();
  model.tool_tip.x.modes = {{1210.0, 0.031, 1.0 / 28e6}};
  model.tool_tip.y.modes = {{1180.0, 0.029, 1.0 / 31e6}};
  model.spindle = smartmill::mill().spindle;
  model.spindle->load_meter_full_scale = 8.0;
  return model;
}

/// A stretch out of a cut that a machine of its own does: the surface stored, from full engagement on.
Stretch runningCut(const MachineModel& model, double speed, double depth) {
  constexpr double RATE = 25600.0, SETTLE = 0.6;
  constexpr int SUBSTEPS = 4;
  Stretch stretch;
  stretch.stamp = 5.0;
  stretch.test.name = "slot";
  stretch.test.sample_rate = RATE;
  stretch.test.spindle_speed = speed;
  stretch.test.running_before = SETTLE;
  stretch.test.engagement = Engagement{0.0, units::PI, depth, 1e-4};
  sim::CuttingMachine machine(model, 1.0 / (RATE * SUBSTEPS));
  sim::CuttingMachine::Input input;
  input.motion.speed = speed;
  input.motion.velocity[0] = 1e-4 * 4 * speed / units::TWO_PI;
  machine.engage({{0.0, units::PI, depth}}, input.motion);
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0.0, SIGMA);
  Record& record = stretch.record;
  for (const char* name : {"spindle_angle", "fx", "fy", "fz"}) record.add(name);
  const int settle = static_cast<int>(SETTLE * RATE), samples = static_cast<int>(0.3 * RATE);
  for (int i = 0; i < settle + samples; ++i) {
    sim::CuttingMachine::Output out;
    for (int s = 0; s < SUBSTEPS; ++s) {
      const double t = (i + static_cast<double>(s) / SUBSTEPS) / RATE;
      input.motion.angle = speed * t;
      input.motion.centre[0] = input.motion.velocity[0] * t;
      const sim::CuttingMachine::Output now = machine.step(input);
      if (s == 0) out = now;
    }
    if (i < settle) continue;
    record.time.push_back((i - settle) / RATE);
    record.columns[0].push_back(std::fmod(speed * i / RATE, units::TWO_PI));
    for (std::size_t axis = 0; axis < 3; ++axis)
      record.columns[axis + 1].push_back(out.sensor[axis] + noise(random));
    if ((i - settle) % 512 == 500) {
      // As the controller tells it: in steps of 1e-4 of the full scale.
      const double load = std::round(out.load_meter / 8.0 / 1e-4) * 1e-4;
      stretch.load.push_back({record.time.back(), load});
    }
  }
  return stretch;
}

// A stretch out of the midst of a running cut, made by another process than the twin's: no transient at its
// begin counts as misfit, and the load meter takes part.
TEST(LiveGap, isOneForARunningCutOfAVibratingTool) {
  const MachineModel model = flexibleMill();
  const Stretch stretch = runningCut(model, units::radPerSecFromRpm(4000.0), 1e-3);
  const LiveGap gap = liveGap(model, stretch, {});
  EXPECT_EQ(gap.aside, "");
  ASSERT_EQ(gap.channels, (std::vector<std::string>{"fx", "fy", "fz", "load_meter"}));
  // 7680 samples: deviation 0.008; the two processes differ by 2e-4 of 500 N or so beside 2 N of noise.
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(gap.gap[k], 1.0, 0.05) << gap.channels[k];
  EXPECT_LT(gap.gap[3], 1.2);
  EXPECT_TRUE(gap.model_fits);
  // A hundredth of the full scale more: 80 mV beside 0.6 mV of half a step and the ripple of a few mV.
  Stretch loaded = stretch;
  for (LoadReading& r : loaded.load) r.load += 0.01;
  EXPECT_GT(liveGap(model, loaded, {}).gap[3], 5.0);
  EXPECT_FALSE(liveGap(model, loaded, {}).model_fits);
}

TEST(LiveGap, setsChatterAside) {
  const MachineModel model = flexibleMill();
  const LiveGap gap = liveGap(model, runningCut(model, units::radPerSecFromRpm(9000.0), 6e-3), {});
  EXPECT_NE(gap.aside.find("chatters at "), std::string::npos) << gap.aside;
  EXPECT_TRUE(gap.model_fits);
  EXPECT_TRUE(gap.channels.empty());
}

TEST(LiveGap, refusesAModelWithoutNoise) {
  const MachineModel with = mill();
  EXPECT_THROW(liveGap(mill(false), slot(with, 1), {}), Error);
}

TEST(RecordStretch, readsBackTheSame) {
  const TemporaryFolder folder;
  const MachineModel model = mill();
  Stretch stretch = slot(model, 3);
  stretch.test.name = "slot 1/2";  // no file's name
  const std::string out = folder.file("campaign");
  recordStretch(model, stretch, out);
  recordStretch(model, stretch, out);
  const Campaign campaign = readCampaign(out);
  ASSERT_EQ(campaign.tests.size(), 2U);
  EXPECT_EQ(campaign.tests[0].name, "slot_1_2");
  EXPECT_EQ(campaign.tests[1].name, "slot_1_2_2");
  EXPECT_NEAR(campaign.tests[0].spindle_speed, 600.0, 600.0 * 1e-6);
  EXPECT_FALSE(campaign.tests[0].engage_time);
  const MachineModel read = readMachineModel(campaign.modelPath());
  const Record record = readRecord(campaign, campaign.tests[1], read);
  ASSERT_EQ(record.size(), stretch.record.size());
  for (const char* channel : {"fx", "fy", "fz"}) {
    const auto &a = record.column(channel), &b = stretch.record.column(channel);
    for (std::size_t i = 0; i < a.size(); ++i)
      ASSERT_NEAR(a[i], b[i], 1e-5 * std::abs(b[i]) + 1e-9);  // six significant digits
  }
  stretch.record = record;
  EXPECT_TRUE(liveGap(read, stretch, {}).model_fits);
}

}  // namespace
}  // namespace smartmill::discrepancy
