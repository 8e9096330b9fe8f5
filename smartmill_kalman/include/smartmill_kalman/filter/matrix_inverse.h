#pragma once

#include <complex>
#include <cstddef>
#include <vector>

#include "smartmill_kalman/sensor/transfer_matrix.h"

namespace smartmill::kalman {

/// Inversion of a sensor's transfer matrix in a stream (Bachrathy and Stepan eq. 2.1, 2.5): at every line
/// (G' G + floor)^-1 G', floor what the matrix is not known to, as filters of finite length run by
/// overlap-save. What comes out is late by latency() samples.
class MatrixInverse {
 public:
  /// @param matrix all lines of its taps @param bandwidth [Hz] full to there, nothing beyond 1.15 times.
  /// @throws Error when the matrix is only a band.
  MatrixInverse(const TransferMatrix& matrix, double bandwidth);

  std::size_t channels() const { return channels_; }
  double sampleRate() const { return sample_rate_; }  ///< [Hz] of the taps; no other can be inverted
  std::size_t latency() const { return latency_; }    ///< [samples]

  /// Takes the next samples, one list a channel [N, N m], of any length. @return as many of the applied force
  /// along x, y, z [N]. @throws Error on another number of channels.
  std::vector<std::vector<double>> process(const std::vector<std::vector<double>>& samples);
  void reset();  ///< at rest

 private:
  void transformTaps(std::size_t length);

  std::size_t channels_, latency_;
  double sample_rate_;
  std::vector<std::vector<double>> taps_;                   // force by channel
  std::vector<std::vector<double>> history_;                // by channel
  std::vector<std::vector<std::complex<double>>> spectra_;  // of the taps, for the block length used last
  std::size_t length_ = 0;
};

}  // namespace smartmill::kalman
