// Effects without a shared campaign: identification from simulated records. Machine and twin share the
// cutting kernel (eight and four steps per sample), so this tests the search; smartmill_sim tests the physics
// of each effect.
#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/testing/temporary_folder.h"

#include "explain/small_campaign.h"

namespace smartmill::discrepancy {
namespace {

void expectFound(const EffectEntry& hidden, const ExplainOptions& explain_options = {}) {
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
      folder.file("."), explain_options);
  EXPECT_EQ(e.verdict, Verdict::explained);
  ASSERT_EQ(e.effects.size(), 1u);
  EXPECT_EQ(e.effects.front().name, hidden.name);
  for (const auto& [key, truth] : numbersOf(hidden)) {
    bool reported = false;
    for (const FoundParameter& p : e.effects.front().parameters) {
      if (p.key != key) continue;
      reported = true;
      EXPECT_NEAR(p.value, truth, 4.0 * p.std_dev) << key;
      EXPECT_LT(p.std_dev, 0.1 * std::abs(truth) + 0.1) << key;
    }
    EXPECT_TRUE(reported) << key;
  }
}

TEST(HiddenEffects, FindsAChippedTooth) {
  EffectEntry hidden;
  hidden.name = "tooth_radius";
  hidden.lists["offset_um"] = {4.0, 6.0, -13.0, 3.0};
  expectFound(hidden);
}

// Teeth are out of the cut in parts of it: more is predicted of four radii than of runout, and only one
// effect is fitted for its predicted gain.
TEST(HiddenEffects, FindsARunoutOfWhichLessIsPredictedThanOfTheRadiiOfTheTeeth) {
  ExplainOptions options;
  options.search.fitted_per_round = 1;
  expectFound(effectEntry("runout", {{"offset_um", 55.0}, {"angle_deg", 100.0}}), options);
}

// All cuts have one depth: only the shape of the forces distinguishes a corner radius from other
// coefficients.
TEST(HiddenEffects, FindsACornerRadius) {
  expectFound(effectEntry("corner_radius", {{"corner_radius_mm", 0.8}}));
}

// All cuts start within a few time constants.
TEST(HiddenEffects, FindsThermalGrowth) {
  expectFound(effectEntry("thermal_growth", {{"growth_um", 58.0}, {"time_constant_s", 190.0}}));
}

// A line at no whole order, with another phase in each record.
TEST(HiddenEffects, FindsABearingTone) {
  expectFound(effectEntry("bearing_tone", {{"order", 5.4}, {"x_n", 4.0}, {"y_n", -2.5}, {"z_n", 1.5}}));
}

}  // namespace
}  // namespace smartmill::discrepancy
