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

// Runout shows in slots, unbalance in air at speed.
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

// Jeffreys' posterior odds of a proportion, by hand: 6 of 8 machines, 1 of 8, 0 of 8.
TEST(Causes, oddsFollowTheShareOfMachinesNotOfExplanations) {
  const FleetCauses fleet = fleetCauses(shop(), "new");
  ASSERT_EQ(fleet.explained, 8u);
  ASSERT_EQ(fleet.causes.size(), 2u);
  EXPECT_EQ(fleet.causes[0].name, "unbalance");
  EXPECT_DOUBLE_EQ(fleet.causes[0].odds, 6.5 / 2.5);
  EXPECT_DOUBLE_EQ(fleet.causes[1].odds, 1.5 / 7.5);
  EXPECT_DOUBLE_EQ(fleet.other_odds, 0.5 / 8.5);
  EXPECT_EQ(fleetCauses(shop(), "b").causes.size(), 1u) << "a machine's own explanations are excluded";
}

TEST(Causes, theFrequentCausesTestComesFirstAndOwnCausesAreLeftOut) {
  const auto plan = proposalsFor("new", shop());
  ASSERT_FALSE(plan.empty());
  EXPECT_EQ(plan[0].test, "air");
  EXPECT_THAT(plan[0].reasons.at(0), HasSubstr("unbalance: size 2 +- 0.1 would show in fx"));
  EXPECT_THAT(plan[0].reasons.at(0), HasSubstr("found on 6 of 8 machines"));
  for (const Proposal& p : proposalsFor("a0", shop())) {
    for (const std::string& reason : p.reasons) EXPECT_THAT(reason, HasSubstr("runout"));
  }
}

/// Two causes of equal size; the first shows in tests of even number, the second in the others.
FleetCauses twoCauses(std::size_t tests, double squares) {
  FleetCauses fleet;
  fleet.explained = 100;
  fleet.other_odds = 1e-9;
  for (const char* name : {"first", "second"}) {
    EvidenceProfile profile;
    for (std::size_t t = 0; t < tests; ++t) {
      const double here = (t % 2 == 0) == (*name == 'f') ? squares : 0.0;
      profile.push_back({{"fx", here}, {"fy", here}});
    }
    fleet.causes.push_back({name, {}, 1.0, {}, {profile}});
  }
  for (std::size_t t = 0; t < tests; ++t) fleet.tests.push_back("t" + std::to_string(t));
  return fleet;
}

// Two equally probable causes, well above the threshold. Each of two channels errs with probability
// 0.02: both right, both wrong, or one of each, which has no information.
TEST(Causes, informationOfATestIsTheEntropyThatItsOutcomesRemove) {
  const FleetCauses fleet = twoCauses(1, 1e9);
  const double right = 0.98 * 0.98, wrong = 0.02 * 0.02, both = right + wrong;
  const double expected = right * std::log(2.0 * right / both) + wrong * std::log(2.0 * wrong / both);
  EXPECT_NEAR(CauseSearch(fleet, {1e6, 1e6}).information(0), expected, 1e-4);
}

// The prior odds are a million to one for the first cause; the outcomes decide nevertheless, and an unknown
// cause is not named.
TEST(Causes, thePriorDoesNotDecide) {
  const FleetCauses fleet = twoCauses(40, 1e4);
  CauseSearch search(fleet, {1e6, 1.0}), strange(fleet, {1e6, 1.0});
  EXPECT_FALSE(search.acceptedHypothesis());
  for (std::size_t t = 0; t < 40; ++t) {
    search.addOutcome(t, t % 2 == 1 ? "fx fy" : "");
    strange.addOutcome(t, t % 4 < 2 ? "fx fy" : "");
  }
  EXPECT_EQ(search.acceptedHypothesis(), 1u);
  EXPECT_FALSE(strange.acceptedHypothesis());
}

// Outcomes share the size of the cause. Two causes show alike except that the second has ten times the
// squares in odd tests. A small first cause shows in none of these, however many there are, and is not
// mistaken for the second; with independent outcomes forty silent tests would be forty observations.
TEST(Causes, outcomesShareTheSizeOfTheCause) {
  FleetCauses fleet = twoCauses(40, 0.0);
  for (std::size_t t = 0; t < 40; ++t) {
    for (const char* channel : {"fx", "fy"}) {
      fleet.causes[0].profiles[0][t][channel] = 30.0;
      fleet.causes[1].profiles[0][t][channel] = t % 2 == 1 ? 300.0 : 30.0;
    }
  }
  CauseSearch small(fleet, {1.0, 1.0}), silent(fleet, {1.0, 1.0});
  for (std::size_t t = 0; t < 40; ++t) {
    small.addOutcome(t, t % 2 == 1 ? "fx fy" : "");  // the second, seven times smaller in size
    silent.addOutcome(t, "");
  }
  EXPECT_EQ(small.acceptedHypothesis(), 1u);
  EXPECT_FALSE(silent.acceptedHypothesis())
      << "each cause may be too small to show, so that no cause is not accepted either";
}

// Odds of each effect of the catalogue for `explain --prior`.
TEST(Causes, oddsForAnExplanation) {
  auto all = shop();
  all.push_back(explained("d", effect("out_of_fashion"), 9.0, 9.0));
  const CauseOdds odds = oddsOf(fleetCauses(all, "new"));
  EXPECT_EQ(odds.machines, 9u);
  EXPECT_DOUBLE_EQ(odds.of("unbalance"), 6.5 / 3.5);
  EXPECT_DOUBLE_EQ(odds.of("tool_wear"), 0.5 / 9.5);
  EXPECT_EQ(odds.listed.count("out_of_fashion"), 0u) << "not in this version's catalogue";
}

TEST(Causes, anExplanationOfSeveralCausesIsUsedOnlyWithoutAnother) {
  auto all = shop();
  all.push_back(explained("d", effect("unbalance") + ", " + effect("runout"), 9.0, 9.0));
  const FleetCauses fleet = fleetCauses(all, "new");
  EXPECT_EQ(fleet.causes[0].profiles.size(), 6u);
  for (const EvidenceProfile& unbalance : fleet.causes[0].profiles)
    EXPECT_EQ(unbalance[1].at("fx"), 0.0) << "in a slot";
  ASSERT_EQ(fleet.causes[1].profiles.size(), 1u);
  EXPECT_EQ(fleet.causes[1].profiles[0][0].at("fx"), 0.0) << "runout in the air";
  EXPECT_DOUBLE_EQ(fleet.causes[1].profiles[0][1].at("fx"), (81.0 - 1.0) / 0.05);
  EXPECT_EQ(fleet.causes[1].machines.size(), 2u);
}

}  // namespace
}  // namespace smartmill::loadmeter
