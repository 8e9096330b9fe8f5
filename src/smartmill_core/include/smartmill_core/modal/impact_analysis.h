#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/frequency_response.h"
#include "smartmill_core/signal/hit.h"

namespace smartmill {

/// FRF estimator: H1 = S_fx / S_ff (Dunwoody eq. 4.26, biased low by noise of the force), H2 = S_xx / S_fx*
/// (eq. 4.27, biased high by noise of the response), Hv between them: sqrt(|H1 H2|) with their phase.
enum class FrfAverage { h1, h2, hv };

/// Fewest samples before a hit for its baseline and noise: a standard deviation to 10 %.
constexpr std::size_t LEAST_QUIET_SAMPLES = 48;

/// Noise of a sample where a structure may still ring: the smaller of its scatter and the noise from sixth
/// differences, which suppress slow ringing.
double noiseUnderRinging(const std::vector<double>& values);

/// Options of the FRF estimate.
struct ImpactOptions {
  bool window_force = true;  ///< Dunwoody eq. 4.17..4.19
  double exponential_time =
      0.0;                      ///< [s] time constant of an exponential window on force and response; 0: none
  double response_scale = 1.0;  ///< [unit of FRF x N / unit of the response] e.g. -sensitivity
  /// [V] gain of a sensor V = gain (gap0 / gap - 1): linearises the response, v / (1 + v / (gain + V
  /// before)), so that the second harmonic of a strong mode does not appear as another mode; response_scale
  /// is then the slope at rest. 0: linear sensor.
  double sensor_gain = 0.0;
  /// [1] of the sample interval, over which the converter averages the nonlinear voltage of such a sensor;
  /// motion within this time raises the mean. 0: instantaneous samples.
  double averaged_share = 0.0;
  std::string unit = "m/N";  ///< of the FRF
  /// Lines on each side over which the variance is averaged. The variance from a few hits is itself
  /// uncertain, and lines that agree by chance would get far too much weight in a fit.
  std::size_t smooth_lines = 8;
};

/// Windows, transforms and averages hits of one point (Dunwoody eq. 4.15..4.27). The baseline before the
/// trigger is subtracted. Standard deviations: with several hits from their scatter, smoothed over
/// neighbouring lines and at least that of the noise before the hits (eq. 4.39; H2: eq. 4.41); with one hit
/// from that noise (eq. 4.29).
class ImpactAnalysis {
 public:
  explicit ImpactAnalysis(const ImpactOptions& options);

  /// @throws Error when length or sample rate differ from the first hit's, on NaN, or without a positive
  /// force.
  void add(const Hit& hit);
  int hits() const { return hits_; }

  /// FRF of all hits so far. @throws Error without a hit.
  FrequencyResponse frf(FrfAverage average = FrfAverage::h1) const;

  /// Subtracts the damping of the exponential window from fitted modes: zeta -= 1 / (time 2 pi f).
  void removeWindowDamping(ModalModel& model) const;

 private:
  ImpactOptions options_;
  int hits_ = 0;
  double sample_rate_ = 0.0;
  std::size_t samples_ = 0;
  std::optional<FrfEstimator> estimator_;
  std::vector<double> force_power_;                                       // [N2] mean |F|^2, sum over hits
  double force_noise_ = 0.0, response_noise_ = 0.0, window_share_ = 0.0;  // sums of squares over hits
};

}  // namespace smartmill
