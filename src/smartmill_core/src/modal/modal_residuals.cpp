#include "modal_residuals.h"

#include <algorithm>
#include <cmath>

namespace smartmill {

using Complex = std::complex<double>;
using Eigen::Index;

double ModalLines::reference() const {
  return std::max(low, frequency.front());
}

std::vector<double> smoothedDeviation(const std::vector<double>& deviation) {
  constexpr std::size_t NEAR = 5;
  std::vector<double> result(deviation.size());
  for (std::size_t i = 0; i < deviation.size(); ++i) {
    const std::size_t first = i > NEAR ? i - NEAR : 0, last = std::min(i + NEAR, deviation.size() - 1);
    double sum = 0.0;
    for (std::size_t j = first; j <= last; ++j) sum += deviation[j] * deviation[j];
    result[i] = std::sqrt(sum / static_cast<double>(last - first + 1));
  }
  return result;
}

bool ModalResiduals::evaluate(const Eigen::VectorXd& at, Eigen::VectorXd* residual,
                              Eigen::MatrixXd* jacobian) const {
  const double s = lines_.scale;
  for (std::size_t i = 0; i < lines_.lines(); ++i) {
    const double f = lines_.frequency[i], w = lines_.weight[i];
    const auto row = static_cast<Index>(2 * i);
    Complex model = lines_.unit_static_gain ? 1.0 : 0.0;
    const auto set = [&](Index column, Complex derivative) {
      if (!jacobian) return;
      (*jacobian)(row, column) = w * derivative.real();
      (*jacobian)(row + 1, column) = w * derivative.imag();
    };
    for (Index k = 0; k < modes_; ++k) {
      const double f0 = std::exp(at[3 * k]), zeta = std::exp(at[3 * k + 1]), gain = s * at[3 * k + 2];
      const Complex h = unitMode(f, f0, zeta);
      const double r = f / f0;
      const Complex shape = lines_.unit_static_gain ? h - 1.0 : h;
      model += gain * shape;
      set(3 * k, gain * h * h * r * Complex(-2.0 * r, 2.0 * zeta));
      set(3 * k + 1, -gain * h * h * Complex(0.0, 2.0 * zeta * r));
      set(3 * k + 2, s * shape);
    }
    const Index next = 3 * modes_;
    if (lines_.direct) {
      const double share = lines_.bent(f, at[next + 1]);
      model += s * at[next] * share;
      set(next, s * share);
      set(next + 1, s * at[next] * share * share * std::pow(f / lines_.frequency.back(), 2));
    }
    (*residual)[row] = w * (model.real() - lines_.value[i].real());
    (*residual)[row + 1] = w * (model.imag() - lines_.value[i].imag());
  }
  return true;
}

}  // namespace smartmill
