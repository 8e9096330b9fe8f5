#pragma once

#include "smartmill_core/model/effect.h"

namespace smartmill::sim {

/// A Shelf in constant steps, from rest; the input is linear between steps.
class ShelfFilter {
 public:
  /// @param time_step [s] > 0
  ShelfFilter(const Shelf& shelf, double time_step);

  double step(double value);

 private:
  Shelf shelf_;
  double decay_, weight_now_,
      weight_before_;  // weights of the low-pass state, of the present and of the previous input
  double low_ = 0.0, last_ = 0.0;
};

}  // namespace smartmill::sim
