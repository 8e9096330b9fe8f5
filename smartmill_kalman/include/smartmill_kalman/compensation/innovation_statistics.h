#pragma once

#include <array>
#include <cstddef>

#include "smartmill_kalman/compensation/compensation_method.h"

namespace smartmill::kalman {

/// Size and whiteness of the normalised innovations of one block.
class InnovationStatistics {
 public:
  /// @param filter after its step: innovation() [N], innovationStd() [N]
  template <class Filter>
  void add(std::size_t axis, const Filter& filter) {
    const double innovation = filter.innovation() / filter.innovationStd();
    squares_[axis] += innovation * innovation;
    products_[axis] += innovation * last_[axis];
    last_[axis] = innovation;
  }
  /// @param samples of the block, each axis
  void report(std::size_t samples, CompensationHealth& health) const;

 private:
  std::array<double, 3> last_{}, squares_{}, products_{};  // products of neighbours
};

}  // namespace smartmill::kalman
