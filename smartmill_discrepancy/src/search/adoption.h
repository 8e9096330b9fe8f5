#pragma once

#include "search/search_state.h"

namespace smartmill::discrepancy {

struct AdoptionOptions {
  int passes = 4;  ///< of a refit with corrected twin
  /// [1] Gain over the squares beyond which a fit has left the range of its derivatives.
  double far = 0.01;
  /// [1] Squares over the current ones above which a fit with stated nominal values is given up.
  double give_up_ratio = 2.0;
};

/// Makes the best fit of a round the current fit.
class Adoption {
 public:
  explicit Adoption(const AdoptionOptions& options = {}) : options_(options) {}

  /// Refits everything until a pass gains less than an effect must; a remaining gain would imitate another
  /// effect. Separately found pieces of one effect are merged into one member.
  void adopt(SearchState& state, FitResult best) const;

  /// Drops members that the fit no longer needs: earlier effects may have imitated the new one.
  void dropUnneeded(SearchState& state) const;

 private:
  void refitFromStated(SearchState& state) const;

  AdoptionOptions options_;
};

}  // namespace smartmill::discrepancy
