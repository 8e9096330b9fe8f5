#pragma once

#include <cstddef>
#include <string>

namespace smartmill::discrepancy {

/// A fitted candidate of the search.
struct CandidateResult {
  std::size_t round = 0;  ///< from 0
  std::string effect, variant;
  double predicted_gain = 0.0;  ///< χ² reduction predicted by the screening
  double delta_bic = 0.0;       ///< BIC gain against the start of the round
  bool accepted = false;
  double seconds = 0.0;         ///< [s] of its fit
  std::size_t simulations = 0;  ///< simulated tests of its fit
};

}  // namespace smartmill::discrepancy
