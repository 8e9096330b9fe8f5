#include "plant/oscillator.h"

#include <cmath>

#include "smartmill_core/units.h"

namespace smartmill::plant {

Oscillator::Oscillator(double frequency, double damping_ratio, double step) {
  const double w = units::TWO_PI * frequency, z = damping_ratio, root = std::sqrt(1.0 - z * z), wd = w * root;
  const double decay = std::exp(-z * w * step), s = decay * std::sin(wd * step),
               c = decay * std::cos(wd * step);
  a_ = z / root * s + c;
  b_ = s / wd;
  c_ = 2.0 * z / (w * step) + ((1.0 - 2.0 * z * z) / (wd * step) - z / root) * s -
       (1.0 + 2.0 * z / (w * step)) * c;
  d_ = 1.0 - 2.0 * z / (w * step) + (2.0 * z * z - 1.0) / (wd * step) * s + 2.0 * z / (w * step) * c;
  e_ = -w / root * s;
  f_ = c - z / root * s;
  g_ = -1.0 / step + (w / root + z / (step * root)) * s + c / step;
  h_ = (1.0 - z / root * s - c) / step;
}

void Oscillator::step(double p) {
  const double value = valueIf(p);
  rate_ = rateIf(p);
  value_ = value;
  p_ = p;
}

}  // namespace smartmill::plant
