#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/model/cause_odds.h"
#include "smartmill_loadmeter/database/shop_records.h"

namespace smartmill::loadmeter {

/// Causes that a shop's explanations named, their frequency, and the channels in which each test shows them.

/// Channels in which a test shows a cause, separated by blanks; empty: none.
using Outcome = std::string;

/// Channels of a test whose gap falls by at least the amount that identifies a cause from a single record.
Outcome outcomeOf(const TestEvidence& test);

/// Squared-gap reduction of each test in FleetCauses::tests by the cause of one explanation, relative to the
/// amount that identifies it in a single record, by channel [1]; empty: not measured.
using EvidenceProfile = std::vector<std::map<std::string, double>>;

/// Cause that machines of a shop have.
struct FleetCause {
  std::string name;
  std::vector<std::string> machines;  ///< machines with this cause
  /// Prior odds for a further machine, (k + 1/2) / (n - k + 1/2) for k of n explained machines (Jeffreys'
  /// prior of a proportion).
  double odds = 0.0;
  FoundCause newest;
  std::vector<EvidenceProfile> profiles;  ///< of the newest explanations, at most eight
};

struct FleetCauses {
  std::size_t explained = 0;       ///< machines with an explanation, whatever its verdict
  double other_odds = 0.0;         ///< prior odds of a cause that none of them has
  std::vector<FleetCause> causes;  ///< most probable first
  std::vector<std::string> tests;  ///< with their conditions where known
};

/// Causes of all machines except one. Explanations with several causes do not show what each cause
/// contributes: they count among the machines, and among the tests only if the cause has no other
/// explanation.
FleetCauses fleetCauses(const std::vector<ModelImprovement>& improvements, const std::string& except);

/// Prior odds of the causes for a further machine, from their frequency in the fleet. Names that are not in
/// the catalogue of effects are left out.
CauseOdds oddsOf(const FleetCauses& fleet);

struct CauseTable;

/// Selects the test with the largest expected information about the cause: one of the fleet's, none, or an
/// unknown one (Lindley 1956: expected reduction of entropy). | Outcomes of one machine's tests are not
/// independent given the cause, because they share its size. Each hypothesis is a mixture of components,
/// within which channels are independent:
/// - a known cause: each of its explanations, with the size scaled by up to a factor of 20 either way
/// (squares scale with the square of the size) and a log-normal difference of 0.5 between the profiles of two
/// machines;
/// - an unknown cause: like a known one with 10 % or 33 % of its channels changed; the same channels in every
/// test; or any channels. The prior affects the choice of tests only. A cause is accepted when the outcomes
/// alone favour it over each other hypothesis by 100 to 1.
class CauseSearch {
 public:
  CauseSearch(const FleetCauses& fleet, const std::vector<double>& odds);
  /// Remaining test with the largest expected information; empty: no test adds information.
  std::optional<std::size_t> next() const;
  void addOutcome(std::size_t test, const Outcome& outcome);
  double information(std::size_t test) const;  ///< [nat] expected
  const std::vector<double>& probabilities() const {
    return probability_;
  }  ///< of each cause, no cause, an unknown cause
  /// Index of the accepted cause; causes.size(): no cause; empty: undecided.
  std::optional<std::size_t> acceptedHypothesis() const;

 private:
  void updateProbabilities();
  std::shared_ptr<const CauseTable> table_;
  std::vector<double> prior_, probability_, evidence_;  // evidence: log likelihood
  std::vector<double> log_weights_;                     // log of weight x likelihood
  std::vector<double> component_probability_;           // of each component
  std::vector<bool> is_done_;
};

/// Test proposed to a machine.
struct Proposal {
  std::string test;
  double information = 0.0;          ///< [nat]
  std::vector<std::string> reasons;  ///< one line for each cause that it may show, most probable first
};

/// Tests in the order in which the machine should make them as long as they show nothing. Causes that its own
/// explanations found are left out.
std::vector<Proposal> proposalsFor(const std::string& machine,
                                   const std::vector<ModelImprovement>& improvements);

}  // namespace smartmill::loadmeter
