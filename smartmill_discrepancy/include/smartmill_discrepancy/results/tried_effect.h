#pragma once

#include <cstddef>
#include <string>

namespace smartmill::discrepancy {

/// One rung of the evidence ladder: an effect that was fitted beside those found before it.
struct TriedEffect {
  std::size_t round = 0;  ///< counts from 0
  std::string effect, variant;
  double promised = 0.0;   ///< gain of the screening
  double delta_bic = 0.0;  ///< of the fit against the round's start; positive is better
  bool taken = false;
  double seconds = 0.0;         ///< [s] that its fit took
  std::size_t simulations = 0;  ///< of single tests, for its fit
};

}  // namespace smartmill::discrepancy
