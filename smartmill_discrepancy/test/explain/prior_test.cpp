// Slots at one speed with a law that depends on the cutting speed, which is equivalent to a smaller feed or
// other coefficients.
#include <optional>
#include <string>

#include <gtest/gtest.h>

#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/testing/temporary_folder.h"

#include "explain/small_campaign.h"

namespace smartmill::discrepancy {
namespace {

Explanation slotsAtOneSpeed(const std::optional<CauseOdds>& prior) {
  const TemporaryFolder folder;
  MachineModel machine = real();
  machine.effects = {effectEntry("cutting_speed", {{"exponent", 0.25}, {"reference_m_per_min", 30.0}})};
  sim::SimulationOptions simulation;
  simulation.substeps = 8;
  ExplainOptions options;
  options.bench.threads = 1;
  options.search.prior = prior;
  return explained(
      [&](const CampaignTest& test, std::uint64_t seed) {
        simulation.seed = seed;
        return sim::simulateTest(machine, test, 0.05, simulation);
      },
      folder.file("."), options,
      {slot("a", 4000, 0.06, 90), slot("b", 4000, 0.03, 180), slot("c", 4000, 0.1, 270),
       slot("d", 4000, 0.08, 360)});
}

CauseOdds odds(const std::string& frequent) {
  CauseOdds odds;
  odds.machines = 30;
  odds.other = 0.5 / 30.5;
  odds.listed = {{frequent, 3.0}};
  return odds;
}

// A feed error and other chip coefficients fit equally. The prior changes the confidence only, neither the
// name nor its values.
TEST(Prior, SetsTheConfidenceOfUnidentifiablePairs) {
  const Explanation without = slotsAtOneSpeed({});
  ASSERT_EQ(without.effects.size(), 1u);
  ASSERT_EQ(without.not_separable.size(), 1u);
  const std::string name = without.not_separable[0][0], alternative = without.not_separable[0][1];
  const Explanation usual = slotsAtOneSpeed(odds(name)), rare = slotsAtOneSpeed(odds(alternative));
  for (const Explanation* e : {&usual, &rare}) {
    ASSERT_EQ(e->effects.size(), 1u);
    EXPECT_EQ(e->verdict, without.verdict);
    EXPECT_EQ(e->effects[0].name, name);
    EXPECT_EQ(e->effects[0].parameters[0].value, without.effects[0].parameters[0].value);
    EXPECT_EQ(e->effects[0].delta_bic, without.effects[0].delta_bic);
    EXPECT_EQ(e->not_separable, without.not_separable);
    EXPECT_EQ(e->suggested_test, without.suggested_test);
  }
  EXPECT_GT(usual.effects[0].confidence, 0.99);
  EXPECT_LT(rare.effects[0].confidence, 0.5) << "prior odds 1 to 183, and hardly any evidence of the records";
  EXPECT_NE(rare.notes.back().find("prior of 30 other machines: odds of " + name + " 0.0164"),
            std::string::npos)
      << rare.notes.back();
}

}  // namespace
}  // namespace smartmill::discrepancy
