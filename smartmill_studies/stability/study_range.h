#pragma once

namespace smartmill::stability {

/// Range from which a study draws its cuts.
struct StudyRange {
  double speed_low = 0.0, speed_high = 0.0;  ///< [rad/s] 0 < low < high
  double max_depth = 0.0;                    ///< [m] > 0 largest depth of the search for limits
  unsigned seed = 1;                         ///< of the draws

  /// @throws Error naming the quantity.
  void validate() const;
};

}  // namespace smartmill::stability
