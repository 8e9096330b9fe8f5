#include "smartmill_sim/effects/shelf_filter.h"

#include <cmath>

namespace smartmill::sim {

ShelfFilter::ShelfFilter(const Shelf& shelf, double time_step) : shelf_(shelf) {
  const double angle = units::TWO_PI * shelf.corner * time_step, loss = -std::expm1(-angle);
  decay_ = 1.0 - loss;
  weight_now_ = 1.0 - loss / angle;
  weight_before_ = loss / angle - decay_;
}

double ShelfFilter::step(double value) {
  low_ = decay_ * low_ + weight_now_ * value + weight_before_ * last_;
  last_ = value;
  return shelf_.above * value + (shelf_.below - shelf_.above) * low_;
}

}  // namespace smartmill::sim
