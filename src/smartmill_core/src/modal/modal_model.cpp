#include "smartmill_core/modal/modal_model.h"

namespace smartmill {

std::complex<double> Mode::response(double f) const {
  const double ratio = f / frequency;
  return gain / std::complex<double>(1.0 - ratio * ratio, 2.0 * damping_ratio * ratio);
}

std::complex<double> ModalModel::response(double f) const {
  std::complex<double> sum = direct;
  for (const Mode& mode : modes) {
    sum += mode.response(f);
  }
  return sum;
}

double ModalModel::staticGain() const {
  double sum = direct;
  for (const Mode& mode : modes) {
    sum += mode.gain;
  }
  return sum;
}

}  // namespace smartmill
