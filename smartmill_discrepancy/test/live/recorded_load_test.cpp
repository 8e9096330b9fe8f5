// The load meter of a session, polled and rounded, recorded in the campaign and used by explain.
#include <cmath>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "smartmill_core/campaign/slow_channels.h"
#include "smartmill_core/testing/mill.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_discrepancy/explain/explain.h"
#include "smartmill_discrepancy/live/live_gap.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {
namespace {

MachineModel believed() {
  MachineModel model = smartmill::mill(4, 30.0);
  model.force_sensor.noise_rms = Axes3{{1.0, 1.0, 1.0}};
  model.spindle->load_meter_full_scale = 8.0;
  return model;
}

// As from the recorder: forces at their rate, some fifty unevenly polled loads per second, rounded to 0.3 mV.
RecordSegment segment(const MachineModel& machine, const std::string& name, double rpm, double feed_mm,
                      std::uint64_t seed) {
  constexpr double LENGTH = 0.3, STEP = 3e-4;
  RecordSegment s;
  s.test.name = name;
  s.test.sample_rate = 12800.0;
  s.test.spindle_speed = units::radPerSecFromRpm(rpm);
  s.test.running_before = 0.5;
  s.test.start_time = 30.0 * static_cast<double>(seed);
  s.test.kind = feed_mm > 0.0 ? TestKind::cut : TestKind::air;
  if (feed_mm > 0.0) s.test.engagement = Engagement{0.0, units::PI, 1e-3, feed_mm * units::MM};
  if (feed_mm > 0.0) s.test.cut_time_before = 2.0 * static_cast<double>(seed);
  sim::SimulationOptions options;
  options.seed = seed;
  options.substeps = 8;
  const Record whole = sim::simulateTest(machine, s.test, LENGTH, options);
  s.record.time = whole.time;
  for (const char* c : {"spindle_angle", "fx", "fy", "fz"}) s.record.add(c) = whole.column(c);
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> late(-0.004, 0.004);
  const std::vector<double>& volts = whole.column("load_meter");
  for (double t = 0.007; t + 0.004 < LENGTH; t += 0.02) {
    const double at = t + late(random);
    const double v = volts.at(static_cast<std::size_t>(at * s.test.sample_rate));
    s.load.push_back({at, std::round(v / STEP) * STEP / 8.0});
  }
  return s;
}

Explanation explained(const MachineModel& machine, const std::string& folder) {
  std::uint64_t seed = 0;
  for (const double rpm : {600.0, 1200.0, 2400.0, 4000.0, 8000.0, 12000.0})
    recordSegment(believed(), segment(machine, "air", rpm, 0.0, ++seed), folder);
  for (const double feed : {0.05, 0.1, 0.15, 0.1})
    recordSegment(believed(), segment(machine, "slot", 4000.0, feed, ++seed), folder);
  const Campaign campaign = readCampaign(folder);
  EXPECT_EQ(readSlowChannels(campaign).size(), 10u);
  return explain(loadDataset(campaign, readMachineModel(campaign.modelPath())), {}, folder);
}

TEST(RecordedLoad, RevealsTheFrictionOfASession) {
  const TemporaryFolder folder;
  MachineModel machine = believed();
  machine.effects = {effectEntry("stribeck_friction", {{"breakaway_nm", 0.4}, {"speed_rpm", 1500.0}})};
  const Explanation e = explained(machine, folder.file("kept"));
  EXPECT_EQ(e.verdict, Verdict::explained);
  ASSERT_EQ(e.effects.size(), 1u);
  EXPECT_EQ(e.effects[0].name, "stribeck_friction");
  for (const FoundParameter& p : e.effects[0].parameters) {
    const double truth = p.key == "breakaway_nm" ? 0.4 : 1500.0;
    EXPECT_NEAR(p.value, truth, 3.0 * p.std_dev) << p.key;
    EXPECT_LT(p.std_dev, 0.2 * truth) << p.key;
  }
}

TEST(RecordedLoad, AgreesWithoutHiddenEffects) {
  const TemporaryFolder folder;
  const Explanation e = explained(believed(), folder.file("kept"));
  EXPECT_EQ(e.verdict, Verdict::no_disagreement);
  for (const TestGap& gap : e.gaps) {
    if (gap.channel == "load_meter") {
      EXPECT_LT(gap.before, 3.0) << gap.test;
    }
  }
}

}  // namespace
}  // namespace smartmill::discrepancy
