#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/model/cause_odds.h"
#include "smartmill_discrepancy/search/separating_test.h"

namespace smartmill::discrepancy {

/// A name and a rival in its place that the records do not part.
struct Unparted {
  std::string name, rival;
  double parted =
      0.0;  ///< [1] gain of BIC of the name against the rival, over the one from which on they are parted
  std::optional<SeparatingTest> test;  ///< that would; none: their predictions differ nowhere
};

/// [1] Probability of the name against the rival (Bayes). BIC knows noise only, so that its odds are
/// tempered: what just parts a pair counts as the three deviations by which an effect is named, nothing as
/// even.
double sureOf(const Unparted& pair, const CauseOdds& prior);

/// The pair whose test is expected to tell most of what is missing: between a name and all its rivals, each
/// as likely as beforehand, a test that parts a from b takes away (p_a + p_b) H(p_a / (p_a + p_b)) of the
/// entropy (Lindley 1956). Without a prior the first that has a test; nullptr: none has.
const Unparted* mostTelling(const std::vector<Unparted>& pairs, const std::optional<CauseOdds>& prior);

}  // namespace smartmill::discrepancy
