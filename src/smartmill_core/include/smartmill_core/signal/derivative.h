#pragma once

#include <vector>

namespace smartmill {

/// Smoothed first or second derivative of an evenly sampled signal: that of a polynomial of degree order + 2
/// fitted around each sample with Gaussian weights (Savitzky-Golay with a smooth window). Exact for such
/// polynomials; a sine of angular frequency w is attenuated by (1 + u / 2) exp(-u / 2), u = (w smoothing)^2,
/// which is 3 dB at 0.23 / smoothing. There is no delay. The signal is continued beyond its ends by mirror
/// reflection (order 1) or point reflection (order 2), so that the derivative tends to 0 there, within about
/// two smoothing lengths.
/// @param order 1 or 2 @param smoothing [s] standard deviation of the weights; at least one sample is used
std::vector<double> smoothedDerivative(const std::vector<double>& signal, double sample_rate, int order,
                                       double smoothing);

}  // namespace smartmill
