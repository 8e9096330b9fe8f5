#include "smartmill_kalman/compensation/innovation_statistics.h"

#include <algorithm>
#include <cmath>

namespace smartmill::kalman {

void InnovationStatistics::report(std::size_t samples, CompensationHealth& health) const {
  double squares = 0.0;
  health.innovation_correlation = 0.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    squares += squares_[axis];
    if (squares_[axis] > 0.0) {
      health.innovation_correlation =
          std::max(health.innovation_correlation, std::abs(products_[axis] / squares_[axis]));
    }
  }
  health.innovation_ratio = samples == 0 ? 0.0 : std::sqrt(squares / (3.0 * static_cast<double>(samples)));
}

}  // namespace smartmill::kalman
