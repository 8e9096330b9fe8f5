#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <vector>

namespace smartmill::studies {

/// The dynamometer of the figures of Dunwoody's chapter 5: elastic bodies on it and an elastic machine table
/// under it (plant/elastic_dynamometer.h), 51 modes an axis, of which the product's sensor model has at
/// most four; the main ones at 930 Hz (x, as in section 5.3) and 1080 Hz (y). Taps are 5 mm below the cut,
/// and each axis shows 1 % of the other one.
struct DynamometerRig {
  static constexpr double RATE = 25600.0;  ///< [Hz]
  static constexpr double NOISE = 1.0;     ///< [N] of a sample, standard deviation

  /// True responses of an axis at the cut [1], without the other axis' share, at the frequencies [Hz].
  static std::vector<std::complex<double>> response(std::size_t axis, const std::vector<double>& frequencies);

  /// Records of taps along an axis [N], 0.2 s each: sin^2 pulses of 0.2 ms and 500 N.
  struct Taps {
    std::vector<std::vector<double>> hammer, response;
  };
  static Taps taps(std::size_t axis, int count, unsigned seed);

  /// A steady slot at a speed: spindle angle [rad] and, in x and y, the applied and the measured force [N].
  struct Cut {
    std::vector<double> angle;
    std::array<std::vector<double>, 2> applied, measured;
  };
  /// @param samples at RATE, from the tool's entry on
  static Cut slot(double rpm, std::size_t samples, unsigned seed);
};

}  // namespace smartmill::studies
