// Effects that no campaign of another program hides: from records of a machine that has them to their names.
// Machine and twin share the kernel of the cut (eight steps a sample here, four there), so that this shows
// the search, not the physics; that stands in smartmill_sim's tests of each effect.
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_discrepancy/explain/explain.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {
namespace {

MachineModel believed() {
  MachineModel m;
  m.tool = ToolGeometry{4, 12e-3, units::radFromDeg(35.0), {}};
  m.cutting = CuttingCoefficients{796e6, 168e6, 222e6, 27.7e3, 30.8e3, 1.4e3};
  m.force_sensor.noise_rms = Axes3{{1.0, 1.0, 1.0}};
  return m;
}

CampaignTest slot(const std::string& name, double rpm, double feed_mm, double start) {
  CampaignTest t;
  t.name = name;
  t.file = name + ".csv";
  t.kind = TestKind::cut;
  t.sample_rate = 12800.0;
  t.spindle_speed = units::radPerSecFromRpm(rpm);
  t.engagement = Engagement{0.0, units::PI, 2e-3, feed_mm * units::MM};
  t.engage_time = 0.02;
  t.start_time = start;
  t.cut_time_before = 0.2 * start;
  return t;
}

/// Slots at three feeds and three speeds, a quarter of an hour long.
Explanation explained(const EffectEntry& hidden, const std::string& folder) {
  Campaign campaign;
  campaign.folder = folder;
  campaign.model_file = "model.yaml";
  campaign.tests = {slot("a", 4500, 0.06, 90),  slot("b", 4500, 0.03, 180), slot("c", 4500, 0.1, 270),
                    slot("d", 3000, 0.06, 360), slot("e", 7200, 0.06, 540), slot("f", 7200, 0.1, 720),
                    slot("g", 3000, 0.03, 810), slot("h", 4500, 0.06, 900)};
  writeMachineModel(believed(), folder + "/model.yaml");
  writeCampaign(campaign, folder);
  MachineModel machine = believed();
  machine.cutting->ktc *= 1.03;  // within what is stated of the values: 3 %
  machine.cutting->kre *= 0.96;
  machine.effects = {hidden};
  sim::SimulationOptions options;
  options.substeps = 8;
  for (const CampaignTest& test : campaign.tests) {
    ++options.seed;
    writeCsv(sim::simulateTest(machine, test, 0.1, options), folder + "/" + test.file);
  }
  return explain(loadDataset(campaign, readMachineModel(campaign.modelPath())), {}, folder);
}

void expectFound(const EffectEntry& hidden) {
  const TemporaryFolder folder;
  const Explanation e = explained(hidden, folder.file("."));
  EXPECT_EQ(e.verdict, Verdict::explained);
  ASSERT_EQ(e.effects.size(), 1u);
  EXPECT_EQ(e.effects.front().name, hidden.name);
  for (const auto& [key, truth] : numbersOf(hidden)) {
    bool told = false;
    for (const FoundParameter& p : e.effects.front().parameters) {
      if (p.key != key) continue;
      told = true;
      EXPECT_NEAR(p.value, truth, 4.0 * p.std_dev) << key;
      EXPECT_LT(p.std_dev, 0.1 * std::abs(truth) + 0.1) << key;
    }
    EXPECT_TRUE(told) << key;
  }
}

TEST(HiddenEffects, aChippedToothIsFound) {
  EffectEntry hidden;
  hidden.name = "tooth_radius";
  hidden.lists["offset_um"] = {4.0, 6.0, -13.0, 3.0};
  expectFound(hidden);
}

// All cuts are of one depth: only the shape of the forces tells a round corner from other coefficients.
TEST(HiddenEffects, aRoundCornerIsFound) {
  expectFound(effectEntry("corner_radius", {{"corner_radius_mm", 0.8}}));
}

// All cuts start within a few time constants.
TEST(HiddenEffects, aWarmingSpindleIsFound) {
  expectFound(effectEntry("thermal_growth", {{"growth_um", 58.0}, {"time_constant_s", 190.0}}));
}

}  // namespace
}  // namespace smartmill::discrepancy
