#include <algorithm>
#include <cmath>

#include "search/adoption.h"
#include "search/steps/nominal_fit.h"
#include "search/steps/search_step.h"

namespace smartmill::discrepancy {
namespace {

struct ContinuationOptions {
  /// [1] of the required gain: smaller gains of shortened records, in proportion to the samples, are not
  /// screened again.
  double worth_screening = 0.25;
};

/// Continues a search on shortened records with the whole records: nominal values and effects start from its
/// result.
class Continuation : public SearchStep {
 public:
  explicit Continuation(const SearchState& shortened) : shortened_(shortened) {}

  void run(SearchState& state) override;

 private:
  void limitGains(SearchState& state) const;

  const SearchState& shortened_;
  ContinuationOptions options_;
  NominalFit nominal_fit_;
  Adoption adoption_;
};

void Continuation::run(SearchState& s) {
  s.options.log("search on whole records");
  s.bench.guidance().set(shortened_.bench.guidance().isActive());
  nominal_fit_.fitFrom(s, shortened_.result.null.state.nominal);
  s.result.candidates = shortened_.result.candidates;
  s.result.rejected = shortened_.result.rejected;
  s.rejected = shortened_.rejected;
  s.rounds = shortened_.rounds;
  s.uncounted_rounds = shortened_.uncounted_rounds + 1;  // one round to confirm the result
  if (shortened_.now.state.members.empty()) {
    limitGains(s);
    return;
  }
  const FitResult null = s.now;
  FitResult start = null;
  start.state = shortened_.now.state;
  adoption_.adopt(s, start);
  const double exact_squares = s.bench.exactSquares(s.now.state);
  if (exact_squares < s.exact_now) {
    s.exact_now = exact_squares;
    limitGains(s);
    return;
  }
  s.now = null;
  s.linearise(s.now.state);
}

// Limits the gains on whole records by the last screening of the shortened ones if both are nearly explained:
// squares grow with the samples, those of effects that grow in time with their third power.
void Continuation::limitGains(SearchState& s) const {
  if (!shortened_.isExplained() || !s.isExplained()) return;
  const double longer = s.bench.samples() / shortened_.bench.samples();
  for (const PredictedGain& p : shortened_.screened)
    s.memory.gain_limits[p.hypothesis] =
        p.gain * std::max(std::pow(longer, 3), longer / options_.worth_screening);
}

}  // namespace

std::unique_ptr<SearchStep> makeContinuation(const SearchState& shortened) {
  return std::make_unique<Continuation>(shortened);
}

}  // namespace smartmill::discrepancy
