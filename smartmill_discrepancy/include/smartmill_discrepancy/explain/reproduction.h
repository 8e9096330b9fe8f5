#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_discrepancy/search/search.h"
#include "smartmill_discrepancy/search/validation.h"

namespace smartmill::discrepancy {

/// Acceptance of an empirical effect. An empirical form adapts to whatever it is fitted to, so each criterion
/// uses held-out tests.
struct ReproductionOptions {
  /// [1] minimum of the held-out share over the fitted share, and of the held-out gain over the squares of
  /// the change; its inverse is the maximum of the latter
  double min_reproduced = 0.5;
  double min_deviations = 3.0;  ///< of the gain, in standard deviations by its scatter over the revolutions
  double max_contradicted = 0.15;  ///< [1] share of the gain that a single test may lose significantly
  std::size_t min_piece = 64;      ///< [samples] of a piece whose gain is one value of the scatter
};

/// Whether held-out tests reproduce what an empirical effect explains in the fitted ones.
class Reproduction {
 public:
  /// @param bench, options must outlive this object
  Reproduction(Workbench& bench, const SearchOptions& options) : bench_(bench), options_(options) {}

  /// A real cause reduces the residual of held-out tests by a similar share as that of the fitted ones.
  bool isReproduced(const FitState& before, const FitResult& with) const;

  /// The validation of search/validation.h with each record weighted by its asynchronous part and aligned
  /// with each model. @param what compared, for the log
  ValidationResult validateWeighted(const FitState& better, const FitState& other,
                                    const std::string& what) const;

 private:
  std::pair<std::vector<double>, std::vector<double>> residualsOf(const FitState& state) const;

  Workbench& bench_;
  const SearchOptions& options_;
  ReproductionOptions criteria_;
};

}  // namespace smartmill::discrepancy
