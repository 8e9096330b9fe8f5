// Effects that no campaign of another program hides: from records of a machine that has them to their names.
// Machine and twin share the kernel of the cut (eight steps a sample here, four there), so that this shows
// the search, not the physics; that stands in smartmill_sim's tests of each effect.
#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/testing/temporary_folder.h"

#include "explain/small_campaign.h"

namespace smartmill::discrepancy {
namespace {

void expectFound(const EffectEntry& hidden) {
  const TemporaryFolder folder;
  MachineModel machine = real();
  machine.effects = {hidden};
  sim::SimulationOptions options;
  options.substeps = 8;
  const Explanation e = explained(
      [&](const CampaignTest& test, std::uint64_t seed) {
        options.seed = seed;
        return sim::simulateTest(machine, test, 0.1, options);
      },
      folder.file("."));
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
