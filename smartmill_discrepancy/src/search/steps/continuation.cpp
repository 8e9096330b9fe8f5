#include <algorithm>
#include <cmath>

#include "search/adoption.h"
#include "search/steps/steps.h"

namespace smartmill::discrepancy {
namespace {

// Limits the gains on whole records by the last screening of the shortened ones if both are nearly explained:
// squares grow with the samples, those of effects that grow in time with their third power.
void limitGains(SearchState& s, const SearchState& shortened) {
  if (!shortened.isExplained() || !s.isExplained()) return;
  const double longer = s.bench.samples() / shortened.bench.samples();
  for (const PredictedGain& p : shortened.screened)
    s.memory.gain_limits[p.hypothesis] =
        p.gain * std::max(std::pow(longer, 3), longer / s.options.worth_screening);
}

}  // namespace

void continueOnWholeRecords(SearchState& s, const SearchState& shortened) {
  s.options.log("search on whole records");
  s.bench.guidance().set(shortened.bench.guidance().isActive());
  fitNominalFrom(s, shortened.result.null.state.nominal);
  s.result.candidates = shortened.result.candidates;
  s.result.rejected = shortened.result.rejected;
  s.rejected = shortened.rejected;
  s.rounds = shortened.rounds;
  s.uncounted_rounds = shortened.uncounted_rounds + 1;  // one round to confirm the result
  if (shortened.now.state.members.empty()) {
    limitGains(s, shortened);
    return;
  }
  const FitResult null = s.now;
  FitResult start = null;
  start.state = shortened.now.state;
  adopt(s, start);
  const double exact_squares = s.bench.exactSquares(s.now.state);
  if (exact_squares < s.exact_now) {
    s.exact_now = exact_squares;
    limitGains(s, shortened);
    return;
  }
  s.now = null;
  s.linearise(s.now.state);
}

}  // namespace smartmill::discrepancy
