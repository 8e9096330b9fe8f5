#pragma once

#include <complex>
#include <cstddef>
#include <string>
#include <vector>

namespace smartmill {

/// A measured or computed frequency response function.
struct FrequencyResponse {
  std::vector<double> frequency;            ///< [Hz] rising
  std::vector<std::complex<double>> value;  ///< [unit]
  std::vector<double> coherence;            ///< [1] Dunwoody eq. 4.40; NaN with a single hit; may be empty
  std::vector<double> std_dev;              ///< [unit] root of E|error|^2; NaN unknown; may be empty
  std::string unit;                         ///< m/N or 1
  int averages = 0;

  std::size_t size() const { return frequency.size(); }
  /// Lines with low <= frequency <= high [Hz].
  FrequencyResponse band(double low, double high) const;
  /// Linear interpolation at a frequency [Hz] inside the lines. @throws Error outside.
  std::complex<double> at(double f) const;
};

/// Averages hits into H1, H2, coherence (Dunwoody eq. 4.20..4.27, 4.40). Variance of H1 from the scatter over
/// hits: |H|^2 (1 - C) / (C (M - 1)); for one hit from the given noise.
class FrfEstimator {
 public:
  /// @param sample_rate [Hz] @param samples per hit
  FrfEstimator(double sample_rate, std::size_t samples);

  /// Adds one hit. @param force [N], response [unit]: windowed, `samples` values each. @throws Error on wrong
  /// length or NaN.
  void add(const std::vector<double>& force, const std::vector<double>& response);

  int hits() const { return hits_; }

  /// Noise of one sample outside the hit, for the standard deviation of a single hit (eq. 4.29). [N], [unit]
  void setNoise(double force_rms, double response_rms, double force_window_power_share);

  FrequencyResponse h1(const std::string& unit) const;
  FrequencyResponse h2(const std::string& unit) const;

 private:
  FrequencyResponse result(const std::string& unit, bool second) const;

  double sample_rate_;
  std::size_t samples_;
  int hits_ = 0;
  std::vector<double> sff_, sxx_;
  std::vector<std::complex<double>> sfx_;
  double force_noise_ = 0.0, response_noise_ = 0.0, force_window_share_ = 1.0;
  bool noise_known_ = false;
};

/// Divides an accelerance by -(2 pi f)^2: receptance [m/N]; the line at zero is dropped.
FrequencyResponse receptanceFromAccelerance(const FrequencyResponse& accelerance);

}  // namespace smartmill
