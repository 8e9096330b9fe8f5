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

/// What one machine explained, the others check: the causes that a shop's explanations named, how often, and
/// what each shows in which test.

/// Channels in which a test shows something, between blanks; empty: in none.
using Outcome = std::string;

/// In which channels a test shows its cause: where the gap lost what would name it in a record alone.
Outcome outcomeOf(const TestEvidence& test);

/// What the tests of one explanation lost with its cause, over what would name it in a record alone, by
/// channel [1]; of FleetCauses::tests, empty: not made.
using Showing = std::vector<std::map<std::string, double>>;

/// A cause that machines of a shop have.
struct FleetCause {
  std::string name;
  std::vector<std::string> machines;  ///< that were found to have it
  /// Beforehand, of one machine more: (k + 1/2) / (n - k + 1/2), k of n explained machines (Jeffreys' prior
  /// of a share).
  double odds = 0.0;
  FoundCause newest;
  std::vector<Showing> shown;  ///< the newest explanations, eight at most
};

struct FleetCauses {
  std::size_t explained = 0;       ///< machines with an explanation, whatever it said
  double other_odds = 0.0;         ///< of a cause that none of them has
  std::vector<FleetCause> causes;  ///< the likeliest first
  std::vector<std::string> tests;  ///< with its condition where that is known
};

/// Of all machines but one. Explanations that named several causes do not tell what each shows: they count
/// among the machines, and among the tests only where no other one tells.
FleetCauses fleetCauses(const std::vector<ModelImprovement>& improvements, const std::string& except);

/// What the fleet's frequency of causes says beforehand of one machine more. Names that the catalogue of
/// effects does not know are left out.
CauseOdds oddsOf(const FleetCauses& fleet);

struct CauseTable;

/// Which test to make next: the one whose outcome is expected to tell most about the cause (Lindley 1956: the
/// entropy that it takes away). One cause, none, or one that nobody has met.
///
/// Outcomes of a machine's tests are not independent given the cause: they share its size. Each hypothesis is
/// a mixture, and within a part of it channels show independently of each other:
/// - a cause: each of its explanations, as large a cause or up to twenty times larger or smaller (squares
/// grow
///   with the size's square), two machines' profiles differing by half a natural logarithm besides;
/// - one that nobody has met: like one that is known but for a tenth or a third of its places; in the same
///   channels whatever the test; anything.
/// The prior weighs the choice of tests only: a cause stands alone where the outcomes speak for it
/// against each other one by 100 to 1, whatever was likely beforehand. Names are an explanation's to give.
class CauseSearch {
 public:
  CauseSearch(const FleetCauses& fleet, const std::vector<double>& odds);
  /// The test not yet made that tells most; empty: none tells anything more.
  std::optional<std::size_t> next() const;
  void saw(std::size_t test, const Outcome& outcome);
  double information(std::size_t test) const;  ///< [nat] that it is expected to give
  const std::vector<double>& probabilities() const { return probability_; }  ///< causes, none, another
  /// Of the causes; or causes.size(): none, the machine is as believed.
  std::optional<std::size_t> alone() const;

 private:
  void weigh();
  std::shared_ptr<const CauseTable> table_;
  std::vector<double> prior_, probability_, evidence_;  // evidence: logarithm of the likelihood
  std::vector<double> parts_;                           // logarithms of weight and likelihood
  std::vector<double> now_;                             // probability of each part
  std::vector<bool> made_;
};

/// Something for a machine to check.
struct Proposal {
  std::string test;
  double information = 0.0;          ///< [nat]
  std::vector<std::string> reasons;  ///< for each cause that it may show, the likeliest first, one line
};

/// Tests in the order in which a machine had better make them while they show nothing. Causes it was found to
/// have itself are left out.
std::vector<Proposal> proposalsFor(const std::string& machine,
                                   const std::vector<ModelImprovement>& improvements);

}  // namespace smartmill::loadmeter
