#pragma once

#include <cstddef>
#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_kalman/filter/fir_filters.h"

namespace smartmill::kalman {

struct InverseParameters {
  double bandwidth = 5000.0;   ///< [Hz] full inversion up to here; > 0
  double transition = 600.0;   ///< [Hz] from there to nothing; > 0
  double noise_share = 2e-5;   ///< [1] >= 0 spectral density of the sensor's noise over that of the force
  double uncertainty = 0.003;  ///< [1] >= 0 standard deviation of H over its static gain
  std::size_t taps = 2048;     ///< > latency; long enough for what the inverse rings
  std::size_t latency = 256;   ///< [samples]
  /// @throws Error naming key and value.
  void validate() const;
};

/// Frequency-domain inversion (Bachrathy and Stepan, section 2): conj(H) / (|H|^2 + uncertainty^2 +
/// noise_share), the optimum when H is known to that standard deviation; as a filter of finite length, run by
/// overlap-save. What comes out is late by latency() samples.
class InverseFilter {
 public:
  /// @param sensor measured over applied force @param sample_rate [Hz]
  InverseFilter(const ModalModel& sensor, double sample_rate, const InverseParameters& parameters);

  /// Takes the next samples [N], in blocks of any length. @return as many of the applied force, latency()
  /// late.
  std::vector<double> process(const std::vector<double>& samples) {
    return filter_.process({samples}).front();
  }
  std::size_t latency() const { return latency_; }  ///< [samples]
  void reset() { filter_.reset(); }                 ///< at rest

 private:
  std::size_t latency_;
  FirFilters filter_;
};

}  // namespace smartmill::kalman
