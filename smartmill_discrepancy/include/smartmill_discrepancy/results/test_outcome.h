#pragma once

#include <string>

namespace smartmill::discrepancy {

/// What two models predict of the test that distinguishes them best.
struct TestOutcome {
  std::string first, second;            ///< the models, by the effect that only it has; empty: moved values
  std::string channel;                  ///< in which they differ most
  double peak = 0.0, other_peak = 0.0;  ///< [unit of the channel] largest magnitude, of the first and second
  double duration = 0.0;                ///< [s] of the record
  bool chatters = false;                ///< by one of the models
};

}  // namespace smartmill::discrepancy
