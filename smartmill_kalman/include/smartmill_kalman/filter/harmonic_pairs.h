#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <vector>

#include "smartmill_core/modal/modal_model.h"

namespace smartmill::kalman {

/// State and model of a HarmonicFilter in decoupled coordinates: the free response of each mode, then each
/// harmonic of the force with the sensor's exact steady-state response to it. Every pair is a rotation.
class HarmonicPairs {
 public:
  // A pair is a rotation (a, b) of (re, im) that contributes (c1, c2) to the measured and g to the applied
  // force. A batch holds four pairs.
  typedef double Vector4 __attribute__((vector_size(32), aligned(8)));
  struct PairBatch {
    Vector4 re, im, a, b, c1, c2, g;
  };
  struct GainBatch {
    Vector4 re, im;
  };
  struct WeightBatch {
    Vector4 g;
  };

  HarmonicPairs(const ModalModel& sensor, double spindle_speed, double sample_rate, int harmonics);

  /// The same number of modes; the state stays in these coordinates.
  void setModel(const ModalModel& sensor, double spindle_speed);
  /// At rest, no force.
  void reset();

  /// A vector in the coordinates of HarmonicGain, for example a gain, in these.
  std::vector<GainBatch> toPairs(const std::vector<double>& state) const;
  /// State in the coordinates of HarmonicGain.
  std::vector<double> state() const;
  void setState(const std::vector<double>& state);

  /// Harmonics of the measured force at the next sample [N]: output = Re sum Y_n, n = 0..N.
  std::vector<std::complex<double>> measuredHarmonics() const;
  /// Harmonic n of the applied force at the next sample [N], 0 the constant: force = Re sum.
  std::complex<double> forceHarmonic(std::size_t n) const {
    const std::size_t i = modes_ + n;
    return {batches_[i / 4].re[i % 4], batches_[i / 4].im[i % 4]};
  }
  void setForceHarmonic(std::size_t n, std::complex<double> force);
  /// Derivative of the predicted sample with respect to the spindle angle [N/rad], steady-state harmonics
  /// only.
  /// @param highest harmonic that is included
  double slope(double highest = 1e9) const;
  double output() const;  ///< [N] predicted sample

  std::vector<PairBatch>& batches() { return batches_; }
  const std::vector<PairBatch>& batches() const { return batches_; }
  const ModalModel& sensor() const { return sensor_; }
  double spindleSpeed() const { return spindle_speed_; }  ///< [rad/s]
  double sampleRate() const { return sample_rate_; }      ///< [Hz]
  std::size_t modes() const { return modes_; }
  int harmonics() const { return harmonics_; }
  std::size_t states() const { return 2 * modes_ + 1 + 2 * static_cast<std::size_t>(harmonics_); }

 private:
  ModalModel sensor_;
  double spindle_speed_ = 0.0, sample_rate_;
  std::size_t modes_;
  int harmonics_;
  std::vector<std::array<double, 4>> modal_;  // transition of each mode's two states, row-major
  std::vector<PairBatch> batches_;
};

}  // namespace smartmill::kalman
