#include "smartmill_discrepancy/search/unparted.h"

#include <cmath>

#include <gtest/gtest.h>

namespace smartmill::discrepancy {
namespace {

Unparted pair(const char* name, const char* rival, bool test = true) {
  Unparted p{name, rival, 0.0, {}};
  if (test) p.test.emplace();
  return p;
}

CauseOdds odds() {
  CauseOdds o;
  o.machines = 12;
  o.other = 0.04;
  o.listed = {{"runout", 4.0}, {"cross_talk", 1.0}, {"unbalance", 1.0}};
  return o;
}

// Bayes by hand. Three deviations of a normal: 0.99865 or 739.8 to 1; a third of that gain of BIC: 9.04 to 1.
TEST(Unparted, priorOddsMultiplyThoseOfTheRecords) {
  Unparted p = pair("runout", "cross_talk");
  EXPECT_NEAR(sureOf(p, odds()), 4.0 / 5.0, 1e-12);
  p.parted = 1.0;
  EXPECT_NEAR(sureOf(p, odds()), 4.0 * 739.8 / (1.0 + 4.0 * 739.8), 1e-6);
  p = pair("cross_talk", "runout");
  p.parted = 1.0 / 3.0;
  EXPECT_NEAR(sureOf(p, odds()), 9.04 / 13.04, 1e-3);
  EXPECT_NEAR(sureOf(pair("cross_talk", "gain_error"), odds()), 1.0 / 1.04, 1e-12) << "one that none has";
}

TEST(Unparted, withoutAPriorTheFirstPairThatHasATest) {
  const std::vector<Unparted> pairs{pair("runout", "a", false), pair("runout", "b"), pair("c", "d")};
  EXPECT_EQ(mostTelling(pairs, {}), &pairs[1]);
  EXPECT_EQ(mostTelling({}, {}), nullptr);
  EXPECT_EQ(mostTelling({pairs[0]}, odds()), nullptr);
}

// Of unbalance (1), cross_talk (1) and gain_error (0.04), probabilities 1, 1 and 0.04 over 2.04: parting the
// two likely ones tells 2 / 2.04 ln 2 = 0.680 nat, parting off the rare one 0.083.
TEST(Unparted, theLikelyRivalIsPartedFirst) {
  const std::vector<Unparted> pairs{pair("unbalance", "gain_error"), pair("unbalance", "cross_talk")};
  EXPECT_EQ(mostTelling(pairs, odds()), &pairs[1]);
  EXPECT_EQ(mostTelling(pairs, {}), &pairs[0]);
}

}  // namespace
}  // namespace smartmill::discrepancy
