#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/model/cause_odds.h"
#include "smartmill_discrepancy/search/separating_test.h"

namespace smartmill::discrepancy {

/// An effect and an alternative that the records do not distinguish.
struct UnidentifiablePair {
  std::string name, alternative;
  double separation =
      0.0;  ///< [1] BIC gain of the effect against the alternative, over the gain that separates them
  std::optional<SeparatingTest> test;  ///< that separates them; none if their predictions never differ
};

/// [1] Probability of the effect against the alternative (Bayes). BIC accounts for noise only, so its odds
/// are tempered: a just separated pair has the odds of three standard deviations, a gain of zero even odds.
double nameProbability(const UnidentifiablePair& pair, const CauseOdds& prior);

/// The pair whose test has the largest expected information. A test that separates a from b reduces the
/// entropy by (p_a + p_b) H(p_a / (p_a + p_b)), with the prior probabilities of the effect and all its
/// alternatives (Lindley 1956). Without a prior the first pair with a test; nullptr: none has one.
const UnidentifiablePair* mostInformative(const std::vector<UnidentifiablePair>& pairs,
                                          const std::optional<CauseOdds>& prior);

}  // namespace smartmill::discrepancy
