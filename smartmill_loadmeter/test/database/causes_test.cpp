#include "smartmill_loadmeter/database/causes.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace smartmill::loadmeter {
namespace {

using ::testing::HasSubstr;

std::string effect(const std::string& name) {
  return "{\"name\": \"" + name +
         "\", \"parameters\": {\"size\": {\"value\": 2.0, \"std\": 0.1}}, "
         "\"delta_bic\": 900.0, \"confidence\": 0.99}";
}

// Runout shows in slots, unbalance in the air at speed.
ModelImprovement explained(const std::string& machine, const std::string& effects, double air, double slot) {
  ModelImprovement i;
  i.machine = machine;
  i.effects = "[" + effects + "]";
  const auto test = [](const std::string& name, double before) {
    return "{\"test\": \"" + name + "\", \"gaps\": {\"fx\": [" + std::to_string(before) + ", 1.0]}}";
  };
  i.tests = "[" + test("air", air) + ", " + test("slot", slot) + "]";
  return i;
}

std::vector<ModelImprovement> shop() {
  std::vector<ModelImprovement> all;
  for (int m = 0; m < 6; ++m)
    all.push_back(explained("a" + std::to_string(m), effect("unbalance"), 5.0, 1.0));
  all.push_back(explained("b", effect("runout"), 1.0, 9.0));
  all.push_back(explained("c", "", 1.0, 1.0));
  all.push_back(explained("c", "", 1.0, 1.0));
  return all;
}

// Jeffreys' posterior odds of a share, by hand: 6 of 8 machines, 1 of 8, 0 of 8.
TEST(Causes, oddsFollowTheShareOfMachinesNotOfExplanations) {
  const FleetCauses fleet = fleetCauses(shop(), "new");
  ASSERT_EQ(fleet.explained, 8u);
  ASSERT_EQ(fleet.causes.size(), 2u);
  EXPECT_EQ(fleet.causes[0].name, "unbalance");
  EXPECT_DOUBLE_EQ(fleet.causes[0].odds, 6.5 / 2.5);
  EXPECT_DOUBLE_EQ(fleet.causes[1].odds, 1.5 / 7.5);
  EXPECT_DOUBLE_EQ(fleet.other_odds, 0.5 / 8.5);
  EXPECT_EQ(fleetCauses(shop(), "b").causes.size(), 1u) << "a machine is no witness for itself";
}

TEST(Causes, theFrequentCausesTestComesFirstAndOwnCausesAreLeftOut) {
  const auto plan = proposalsFor("new", shop());
  ASSERT_FALSE(plan.empty());
  EXPECT_EQ(plan[0].test, "air");
  EXPECT_THAT(plan[0].reasons.at(0), HasSubstr("unbalance: size 2 +- 0.1 would show in fx"));
  EXPECT_THAT(plan[0].reasons.at(0), HasSubstr("6 of 8 machines have it"));
  for (const Proposal& p : proposalsFor("a0", shop())) {
    for (const std::string& reason : p.reasons) EXPECT_THAT(reason, HasSubstr("runout"));
  }
}

// Of two equally likely causes with outcomes of their own, one test tells all: ln 2, less what is different.
TEST(Causes, aTestTellsWhatItsOutcomesPart) {
  std::vector<ModelImprovement> two{explained("a", effect("unbalance"), 5.0, 1.0),
                                    explained("b", effect("runout"), 1.0, 9.0)};
  FleetCauses fleet = fleetCauses(two, "");
  fleet.other_odds = 1e-12;
  const CauseSearch search(fleet, {1e9, 1e9});
  EXPECT_NEAR(search.information(0), std::log(2.0), 0.05);
}

// The prior is a thousand to one for unbalance; what the tests show decides all the same.
TEST(Causes, thePriorNamesNothing) {
  const FleetCauses fleet = fleetCauses(shop(), "new");
  CauseSearch search(fleet, {1000.0, 1.0});
  EXPECT_FALSE(search.alone());
  search.saw(1, "fx");  // the slot, where runout shows
  search.saw(0, "");
  ASSERT_TRUE(search.alone());
  EXPECT_EQ(fleet.causes[*search.alone()].name, "runout");
  CauseSearch strange(fleet, {1000.0, 1.0});
  strange.saw(0, "fz");  // as no cause that anybody has
  strange.saw(1, "fy fz");
  EXPECT_FALSE(strange.alone());
}

TEST(Causes, anExplanationOfSeveralCausesTellsNoTestWhereAnotherDoes) {
  auto all = shop();
  all.push_back(explained("d", effect("unbalance") + ", " + effect("runout"), 9.0, 9.0));
  const FleetCauses fleet = fleetCauses(all, "new");
  EXPECT_EQ(fleet.causes[0].outcomes[1], (Outcomes{{"", 1.0}})) << "unbalance in a slot";
  EXPECT_EQ(fleet.causes[1].outcomes[0], (Outcomes{{"", 1.0}})) << "runout in the air";
  EXPECT_EQ(fleet.causes[1].machines.size(), 2u);
}

}  // namespace
}  // namespace smartmill::loadmeter
