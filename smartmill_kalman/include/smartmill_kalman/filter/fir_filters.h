#pragma once

#include <complex>
#include <cstddef>
#include <vector>

namespace smartmill::kalman {

/// Gain of a band that ends by half a cosine: 1 where `beyond` is 0 or less, 0 from 1 on.
double fadeOut(double beyond);

/// Response of a regularised inverse as a filter of finite length (design of InverseFilter and
/// MatrixInverse).
struct FirDesign {
  double sample_rate = 0.0;  ///< [Hz]
  std::size_t samples = 0;   ///< of the transform; even
  std::size_t taps = 0;      ///< <= samples; the last eighth is tapered to 0 by half a cosine
  std::size_t latency = 0;   ///< [samples] for the part of the inverse before the hit

  /// Factor of a line for the latency, with the gain of the band. @param f [Hz]
  std::complex<double> late(double f, double gain) const;
  /// Taps of a filter from its response at every line, latency included.
  std::vector<double> tapsOf(const std::vector<std::complex<double>>& response) const;
};

/// Filters of one length from each input to each output, run by overlap-save.
class FirFilters {
 public:
  /// @param taps of output 0 from all inputs, of output 1, ...; all of one length
  FirFilters(std::size_t inputs, std::vector<std::vector<double>> taps);

  std::size_t inputs() const { return history_.size(); }
  /// @param samples the next of each input, of any number. @return as many of each output
  std::vector<std::vector<double>> process(const std::vector<std::vector<double>>& samples);
  void reset();  ///< at rest

 private:
  void transformTaps(std::size_t length);

  std::vector<std::vector<double>> taps_, history_;
  std::vector<std::vector<std::complex<double>>> spectra_;  // of the taps, for the block length used last
  std::size_t length_ = 0;
};

}  // namespace smartmill::kalman
