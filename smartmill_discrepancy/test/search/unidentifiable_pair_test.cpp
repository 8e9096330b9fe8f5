#include "smartmill_discrepancy/search/unidentifiable_pair.h"

#include <cmath>

#include <gtest/gtest.h>

namespace smartmill::discrepancy {
namespace {

UnidentifiablePair pair(const char* name, const char* alternative, bool test = true) {
  UnidentifiablePair p{name, alternative, 0.0, {}};
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

// Bayes by hand. Three standard deviations of a normal distribution: 0.99865 or 739.8 to 1; a third of that
// BIC gain: 9.04 to 1.
TEST(UnidentifiablePair, PriorOddsMultiplyThoseOfTheRecords) {
  UnidentifiablePair p = pair("runout", "cross_talk");
  EXPECT_NEAR(nameProbability(p, odds()), 4.0 / 5.0, 1e-12);
  p.separation = 1.0;
  EXPECT_NEAR(nameProbability(p, odds()), 4.0 * 739.8 / (1.0 + 4.0 * 739.8), 1e-6);
  p = pair("cross_talk", "runout");
  p.separation = 1.0 / 3.0;
  EXPECT_NEAR(nameProbability(p, odds()), 9.04 / 13.04, 1e-3);
  EXPECT_NEAR(nameProbability(pair("cross_talk", "gain_error"), odds()), 1.0 / 1.04, 1e-12)
      << "an effect of no other machine";
}

TEST(UnidentifiablePair, FirstPairWithATestWithoutPrior) {
  const std::vector<UnidentifiablePair> pairs{pair("runout", "a", false), pair("runout", "b"),
                                              pair("c", "d")};
  EXPECT_EQ(mostInformative(pairs, {}), &pairs[1]);
  EXPECT_EQ(mostInformative({}, {}), nullptr);
  EXPECT_EQ(mostInformative({pairs[0]}, odds()), nullptr);
}

// Of unbalance (1), cross_talk (1) and gain_error (0.04), probabilities 1, 1 and 0.04 over 2.04: separating
// the two likely ones gives 2 / 2.04 ln 2 = 0.680 nat, separating the rare one 0.083.
TEST(UnidentifiablePair, LikelyAlternativeIsSeparatedFirst) {
  const std::vector<UnidentifiablePair> pairs{pair("unbalance", "gain_error"),
                                              pair("unbalance", "cross_talk")};
  EXPECT_EQ(mostInformative(pairs, odds()), &pairs[1]);
  EXPECT_EQ(mostInformative(pairs, {}), &pairs[0]);
}

}  // namespace
}  // namespace smartmill::discrepancy
