#include "smartmill_discrepancy/live/live_gap.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/frames.h"
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

RecordSegment slot(const MachineModel& model, std::uint64_t seed) {
  RecordSegment segment;
  segment.stamp = 12.3;
  segment.test.name = "slot";
  segment.test.sample_rate = 25600.0;
  segment.test.spindle_speed = 600.0;
  Engagement engagement;
  engagement.feed_per_tooth = 1e-4;
  engagement.axial_depth = 1e-3;
  engagement.entry = 0.0;
  engagement.exit = units::TWO_PI / 2.0;
  segment.test.engagement = engagement;
  sim::SimulationOptions options;
  options.seed = seed;
  segment.record = sim::simulateTest(model, segment.test, 0.3, options);
  return segment;
}

// RMS of n samples of white noise over its standard deviation: 1 with deviation 1 / sqrt(2 n).
TEST(LiveGap, IsOneForTheTwinsOwnRecord) {
  const MachineModel model = mill();
  double sum2 = 0.0;
  int count = 0;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const RecordSegment segment = slot(model, seed);
    const LiveGap gap = liveGap(model, segment, {});
    const double deviation =
        1.0 / std::sqrt(static_cast<double>(segment.record.size()));  // half of it is compared
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

// A tone of amplitude a with noise s: sqrt(1 + a^2 / (2 s^2)).
TEST(LiveGap, RisesByAKnownTone) {
  const MachineModel model = mill();
  RecordSegment segment = slot(model, 7);
  constexpr double AMPLITUDE = 3.0 * SIGMA;
  Record& record = segment.record;
  for (std::size_t c = 0; c < record.names.size(); ++c) {
    if (record.names[c] != "fy") continue;
    for (std::size_t i = 0; i < record.size(); ++i)
      record.columns[c][i] += AMPLITUDE * std::sin(units::TWO_PI * 200.0 * record.time[i]);
  }
  const LiveGap gap = liveGap(model, segment, {});
  EXPECT_FALSE(gap.model_fits);
  const double n = static_cast<double>(segment.record.size()) / 2.0, expected = std::sqrt(1.0 + 9.0 / 2.0);
  // Variance of the mean of (tone + noise)^2: (2 + 4 a^2 / 2) / n in units of the noise.
  const double deviation = std::sqrt((2.0 + 18.0) / n) / (2.0 * expected);
  EXPECT_NEAR(gap.gap[1], expected, 4.0 * deviation);
  EXPECT_NEAR(gap.gap[0], 1.0, 0.06);
  EXPECT_NEAR(gap.gap[2], 1.0, 0.06);
}

/// A vibrating tool and a spindle with a load meter.
MachineModel flexibleMill() {
  MachineModel model = mill();
  model.tool_tip.x.modes = {{1210.0, 0.031, 1.0 / 28e6}};
  model.tool_tip.y.modes = {{1180.0, 0.029, 1.0 / 31e6}};
  model.spindle = smartmill::mill().spindle;
  model.spindle->load_meter_full_scale = 8.0;
  return model;
}

/// A segment of a cut simulated by CuttingMachine from full engagement on.
RecordSegment runningCut(const MachineModel& model, double speed, double depth) {
  constexpr double RATE = 25600.0, SETTLE = 0.6;
  constexpr int SUBSTEPS = 4;
  RecordSegment segment;
  segment.stamp = 5.0;
  segment.test.name = "slot";
  segment.test.sample_rate = RATE;
  segment.test.spindle_speed = speed;
  segment.test.running_before = SETTLE;
  segment.test.engagement = Engagement{0.0, units::PI, depth, 1e-4};
  sim::CuttingMachine machine(model, 1.0 / (RATE * SUBSTEPS));
  sim::CuttingMachine::Input input;
  input.motion.speed = speed;
  input.motion.velocity[0] = 1e-4 * 4 * speed / units::TWO_PI;
  machine.engage({{0.0, units::PI, depth}}, input.motion);
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0.0, SIGMA);
  Record& record = segment.record;
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
      // Resolution of the controller: 1e-4 of the full scale.
      const double load = std::round(out.load_meter / 8.0 / 1e-4) * 1e-4;
      segment.load.push_back({record.time.back(), load});
    }
  }
  return segment;
}

// A segment from the middle of a cut, simulated by another process than the twin's: no initial transient, and
// the load meter is compared.
TEST(LiveGap, IsOneForARunningCutOfAVibratingTool) {
  const MachineModel model = flexibleMill();
  const RecordSegment segment = runningCut(model, units::radPerSecFromRpm(4000.0), 1e-3);
  const LiveGap gap = liveGap(model, segment, {});
  EXPECT_EQ(gap.exclusion, "");
  ASSERT_EQ(gap.channels, (std::vector<std::string>{"fx", "fy", "fz", "load_meter"}));
  // 7680 samples: deviation 0.008; the two processes differ by 2e-4 of about 500 N, with 2 N of noise.
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(gap.gap[k], 1.0, 0.05) << gap.channels[k];
  EXPECT_LT(gap.gap[3], 1.2);
  EXPECT_TRUE(gap.model_fits);
  // One percent of full scale more: 80 mV; noise 0.6 mV of half a step and a ripple of a few mV.
  RecordSegment loaded = segment;
  for (LoadMeasurement& r : loaded.load) r.load += 0.01;
  EXPECT_GT(liveGap(model, loaded, {}).gap[3], 5.0);
  EXPECT_FALSE(liveGap(model, loaded, {}).model_fits);
}

TEST(LiveGap, ExcludesChatter) {
  const MachineModel model = flexibleMill();
  const LiveGap gap = liveGap(model, runningCut(model, units::radPerSecFromRpm(9000.0), 6e-3), {});
  EXPECT_NE(gap.exclusion.find("chatters at "), std::string::npos) << gap.exclusion;
  EXPECT_TRUE(gap.model_fits);
  EXPECT_TRUE(gap.channels.empty());
}

TEST(LiveGap, RejectsAModelWithoutNoise) {
  const MachineModel with = mill();
  EXPECT_THROW(liveGap(mill(false), slot(with, 1), {}), Error);
}

TEST(RecordSegmentFiles, ReadBackEqual) {
  const TemporaryFolder folder;
  const MachineModel model = mill();
  RecordSegment segment = slot(model, 3);
  segment.test.name = "slot 1/2";  // invalid as a file name
  const std::string out = folder.file("campaign");
  recordSegment(model, segment, out);
  recordSegment(model, segment, out);
  const Campaign campaign = readCampaign(out);
  ASSERT_EQ(campaign.tests.size(), 2U);
  EXPECT_EQ(campaign.tests[0].name, "slot_1_2");
  EXPECT_EQ(campaign.tests[1].name, "slot_1_2_2");
  EXPECT_NEAR(campaign.tests[0].spindle_speed, 600.0, 600.0 * 1e-6);
  EXPECT_FALSE(campaign.tests[0].engage_time);
  const MachineModel read = readMachineModel(campaign.modelPath());
  const Record record = readRecord(campaign, campaign.tests[1], read);
  ASSERT_EQ(record.size(), segment.record.size());
  for (const char* channel : {"fx", "fy", "fz"}) {
    const auto &a = record.column(channel), &b = segment.record.column(channel);
    for (std::size_t i = 0; i < a.size(); ++i)
      ASSERT_NEAR(a[i], b[i], 1e-5 * std::abs(b[i]) + 1e-9);  // six significant digits
  }
  segment.record = record;
  EXPECT_TRUE(liveGap(read, segment, {}).model_fits);
}

// Compensated forces are those on the tool: the twin has no modes of the sensor, and an error of the sensor
// in proportion to the force is part of the noise.
TEST(LiveGap, ComparesCompensatedForcesWithTheForceOnTheTool) {
  MachineModel model = mill();
  model.frames[frames::DYNAMOMETER] = {frames::TABLE, {{0, 0, 0}}, {{0, 0, 0.5, std::sqrt(0.75)}}};
  const MachineModel ideal = comparedModel(model, ComparedForce::compensated);
  EXPECT_FALSE(placedFrame(ideal.frames, frames::DYNAMOMETER, frames::MACHINE).isTurned());
  EXPECT_TRUE(ideal.force_sensor.axis[0].modes.empty());
  ASSERT_TRUE(ideal.force_sensor.noise_rms);
  RecordSegment segment = slot(ideal, 3);
  for (std::vector<double>& column : segment.record.columns) {
    if (&column == &segment.record.column("spindle_angle")) continue;
    for (double& force : column) force *= 1.03;
  }
  LiveGapOptions options;
  EXPECT_FALSE(liveGap(ideal, segment, options).model_fits);
  options.compared = ComparedForce::compensated;
  const LiveGap gap = liveGap(ideal, segment, options);
  EXPECT_TRUE(gap.model_fits);
  EXPECT_FALSE(liveGap(model, segment, options).model_fits);  // the sensor's mode at 930 Hz
}

}  // namespace
}  // namespace smartmill::discrepancy
