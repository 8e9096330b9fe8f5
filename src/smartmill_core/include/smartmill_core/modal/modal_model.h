#pragma once

#include <complex>
#include <limits>
#include <vector>

namespace smartmill {

/// One mode of a linear structure: gain w_n^2 / (w_n^2 - w^2 + 2 i zeta w_n w).
struct Mode {
  double frequency = 0.0;      ///< [Hz] natural frequency w_n / 2 pi
  double damping_ratio = 0.0;  ///< [1]
  double gain = 0.0;           ///< [unit of the model] static gain; for a receptance 1 / stiffness [m/N]
  double frequency_std = std::numeric_limits<double>::quiet_NaN();      ///< [Hz]
  double damping_ratio_std = std::numeric_limits<double>::quiet_NaN();  ///< [1]
  double gain_std = std::numeric_limits<double>::quiet_NaN();           ///< [unit of the model]

  std::complex<double> response(double f) const;  ///< [unit of the model] at f [Hz]
};

/// Sum of modes and a direct share: H(f) = direct + sum of Mode::response (Dunwoody eq. 5.5 with K_k / w_k^2
/// = gain). Unit m/N (receptance of a tool tip) or 1 (force sensor: measured over applied force).
struct ModalModel {
  std::vector<Mode> modes;
  double direct = 0.0;  ///< [unit] share without dynamics
  double direct_std = std::numeric_limits<double>::quiet_NaN();

  std::complex<double> response(double f) const;  ///< [unit] at f [Hz]
  double staticGain() const;                      ///< [unit] response at zero frequency
};

}  // namespace smartmill
