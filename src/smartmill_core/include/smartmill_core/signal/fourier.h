#pragma once

#include <complex>
#include <cstddef>
#include <vector>

namespace smartmill {

/// One-sided transform of a real signal: X[k] = sum_n x[n] exp(-2 pi i k n / N), k = 0..N/2 (FFTW).
/// @throws Error on an empty signal.
std::vector<std::complex<double>> fourier(const std::vector<double>& signal);

/// Inverse of fourier(): the real signal of n samples. @throws Error when spectrum.size() is not n / 2 + 1.
std::vector<double> inverseFourier(const std::vector<std::complex<double>>& spectrum, std::size_t n);

/// Frequencies [Hz] of the lines of fourier() for n samples at sample_rate [Hz].
std::vector<double> fourierFrequencies(std::size_t n, double sample_rate);

}  // namespace smartmill
