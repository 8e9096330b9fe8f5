#pragma once

#include "smartmill_core/model/effect.h"

namespace smartmill::sim {

/// A Shelf in steps of constant length, from rest; its input runs straight between steps.
class ShelfFilter {
 public:
  /// @param time_step [s] > 0
  ShelfFilter(const Shelf& shelf, double time_step);

  double step(double value);

 private:
  Shelf shelf_;
  double keep_, now_, before_;  // weights of what was low, of the value now and a step ago
  double low_ = 0.0, last_ = 0.0;
};

}  // namespace smartmill::sim
