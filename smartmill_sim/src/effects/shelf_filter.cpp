#include "smartmill_sim/effects/shelf_filter.h"

#include <cmath>

namespace smartmill::sim {

ShelfFilter::ShelfFilter(const Shelf& shelf, double time_step) : shelf_(shelf) {
  const double turned = units::TWO_PI * shelf.corner * time_step, lost = -std::expm1(-turned);
  keep_ = 1.0 - lost;
  now_ = 1.0 - lost / turned;
  before_ = lost / turned - keep_;
}

double ShelfFilter::step(double value) {
  low_ = keep_ * low_ + now_ * value + before_ * last_;
  last_ = value;
  return shelf_.above * value + (shelf_.below - shelf_.above) * low_;
}

}  // namespace smartmill::sim
