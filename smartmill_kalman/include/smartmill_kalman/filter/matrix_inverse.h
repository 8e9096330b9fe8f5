#pragma once

#include <cstddef>
#include <vector>

#include "smartmill_kalman/filter/fir_filters.h"
#include "smartmill_kalman/sensor/transfer_matrix.h"

namespace smartmill::kalman {

struct MatrixInverseParameters {
  double roll_off = 0.15;  ///< [1] of the bandwidth, over which the band ends: a shorter one rings longer
  double latency =
      0.01;  ///< [s] for the part of the inverse before an impulse; 3 periods of a mode at 300 Hz
};

/// Inversion of a sensor's transfer matrix in a stream (Bachrathy and Stepan eq. 2.1, 2.5): at every line
/// (G' G + floor)^-1 G', floor what the matrix is not known to, as filters of finite length run by
/// overlap-save. What comes out is late by latency() samples.
class MatrixInverse {
 public:
  /// @param matrix all lines of its taps @param bandwidth [Hz] full to there, nothing from the roll-off on.
  /// @throws Error when the matrix is only a band.
  MatrixInverse(const TransferMatrix& matrix, double bandwidth,
                const MatrixInverseParameters& parameters = {});

  std::size_t channels() const { return filters_.inputs(); }
  double sampleRate() const { return design_.sample_rate; }  ///< [Hz] of the taps; no other can be inverted
  std::size_t latency() const { return design_.latency; }    ///< [samples]

  /// Takes the next samples, one list a channel [N, N m], of any length. @return as many of the applied force
  /// along x, y, z [N]. @throws Error on another number of channels.
  std::vector<std::vector<double>> process(const std::vector<std::vector<double>>& samples);
  void reset() { filters_.reset(); }  ///< at rest

 private:
  FirDesign design_;
  FirFilters filters_;  // of x, y, z by channel
};

}  // namespace smartmill::kalman
