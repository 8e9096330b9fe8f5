#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_discrepancy/fit/fit.h"
#include "smartmill_discrepancy/search/screening.h"

namespace smartmill::discrepancy {

struct SearchOptions {
  int threads = 2;
  int screening_substeps = 1;
  int final_substeps = 8;
  std::size_t fitted_per_round = 5;  ///< hypotheses that a round fits after screening
  std::size_t most_effects = 8;
  double least_gain = 100.0;  ///< [1] difference of BIC below which nothing is named
  double least_prior_gain =
      3.0;  ///< [1] the same where it comes from nominal values that need not be pulled off any more
  double twin_accuracy = 2e-4;  ///< [1] of the signal, by which two faithful simulations differ
  double least_share = 0.05;    ///< [1] of the squares above the noise that an effect must take
  std::function<void(const std::string&)> progress;
  /// Turns records without spindle angle to where a model fits best and returns by how much [rad]; empty
  /// where every record has its angle.
  std::function<double(const MachineModel&)> turn_phases;
};

/// One rung of the evidence ladder: an effect that was fitted beside those found before it.
struct Rung {
  std::size_t round = 0;  ///< counts from 0
  std::string effect, variant;
  double promised = 0.0;   ///< gain of the screening
  double delta_bic = 0.0;  ///< of the fit against the round's start; positive is better
  bool taken = false;
  double seconds = 0.0;         ///< [s] that its fit took
  std::size_t simulations = 0;  ///< of single tests, for its fit
  const Hypothesis* hypothesis = nullptr;
  std::vector<double> values;  ///< as fitted then
};

/// Another effect fitted in the place of a member.
struct Rival {
  std::size_t member = 0;
  std::string effect, variant;
  double delta_bic = 0.0;  ///< against the model without the member
  FitState state;
};

struct SearchResult {
  Fit null;  ///< nominal values only, on the fit tests
  Fit best;  ///< with the effects found
  std::vector<Rung> ladder;
  std::vector<double> contribution;  ///< of each member: BIC that is lost without it, others fitted again
  std::vector<bool> needed;          ///< whether that is enough to name it
  std::vector<Rival> rivals;
};

/// Fits a state with every value free and simulated exactly, and measures what each member contributes and
/// how its best rivals do in its place.
void refine(TwinRunner& quick_runner, const Fitter& quick, const Fitter& exact, const FitState& state,
            const SearchOptions& options, SearchResult* result);

/// The cut or air cut, among variations of the campaign's tests, in which two models differ most.
std::optional<std::string> separatingTest(const Dataset& data, const MachineModel& a, const MachineModel& b);

/// Forward addition of effects with re-fitting and pruning, on the tests of the runner.
/// @param quick_runner the runner of quick, kept equal to the exact one at the state the search stands at
SearchResult search(TwinRunner& quick_runner, const Fitter& quick, const Fitter& exact,
                    const std::vector<Hypothesis>& hypotheses, const SearchOptions& options);

}  // namespace smartmill::discrepancy
