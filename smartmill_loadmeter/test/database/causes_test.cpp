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

/// Two causes, well known; the first shows in tests of even number, the second in the others.
FleetCauses two(std::size_t tests, double explanations) {
  FleetCauses fleet;
  fleet.explained = 100;
  fleet.other_odds = 1e-9;
  for (const char* name : {"first", "second"}) {
    fleet.causes.push_back({name, {}, 1.0, {}, {}});
    for (std::size_t t = 0; t < tests; ++t)
      fleet.causes.back().outcomes.push_back({{(t % 2 == 0) == (*name == 'f') ? "fx" : "", explanations}});
  }
  for (std::size_t t = 0; t < tests; ++t) fleet.tests.push_back("t" + std::to_string(t));
  return fleet;
}

// Of two equally likely causes that a test parts surely: ln 2.
TEST(Causes, aTestTellsWhatItsOutcomesPart) {
  const FleetCauses fleet = two(1, 1e6);
  EXPECT_NEAR(CauseSearch(fleet, {1e6, 1e6}).information(0), std::log(2.0), 1e-4);
}

// The prior is a million to one for the first; what the tests show decides all the same, and what nobody has
// met is given no name.
TEST(Causes, thePriorNamesNothing) {
  const FleetCauses fleet = two(16, 20.0);
  CauseSearch search(fleet, {1e6, 1.0}), strange(fleet, {1e6, 1.0});
  EXPECT_FALSE(search.alone());
  for (std::size_t t = 0; t < 16; ++t) {
    search.saw(t, t % 2 == 1 ? "fx" : "");
    strange.saw(t, "fy fz");
  }
  EXPECT_EQ(search.alone(), 1u);
  EXPECT_FALSE(strange.alone());
}

TEST(Causes, anExplanationOfSeveralCausesTellsNoTestWhereAnotherDoes) {
  auto all = shop();
  all.push_back(explained("d", effect("unbalance") + ", " + effect("runout"), 9.0, 9.0));
  const FleetCauses fleet = fleetCauses(all, "new");
  EXPECT_EQ(fleet.causes[0].outcomes[1], (Outcomes{{"", 6.0}})) << "unbalance in a slot";
  EXPECT_EQ(fleet.causes[1].outcomes[0], (Outcomes{{"", 1.0}})) << "runout in the air";
  EXPECT_EQ(fleet.causes[1].machines.size(), 2u);
}

}  // namespace
}  // namespace smartmill::loadmeter
