#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/modal/modal_fit.h"
#include "smartmill_core/signal/frequency_response.h"

namespace smartmill {
namespace hammer {

/// One recorded hit: hammer force and response, evenly sampled.
struct Hit {
  double stamp = 0.0;            ///< [s] of the trigger
  double sample_rate = 0.0;      ///< [Hz]
  std::size_t pre_trigger = 0;   ///< [1] samples before the trigger
  std::vector<double> force;     ///< [N]
  std::vector<double> response;  ///< [V], [m] or [m/s2]
};

/// What makes a hit useless.
struct HitLimits {
  double weak_force = 20.0;  ///< [N] a peak below this is a weak hit, > 0
  double second_hit_share =
      0.1;                      ///< [1] a second peak above this share of the main one is a double hit, 0..1
  double response_range = 0.0;  ///< [unit of the response] a response reaching this is clipped; 0: unknown
};

/// Why a hit cannot be used.
struct HitFault {
  std::string text;       ///< one line; empty: the hit can be used
  bool bad_data = false;  ///< clipped, NaN, lost samples; otherwise the blow itself was weak or double
};
HitFault hitFault(const Hit& hit, const HitLimits& limits);

/// Receptance factor of Dunwoody eq. 4.44: direct FRF at the tip from a hit offset [m] above it, tool of
/// stickout L [m]: 2 L^3 / (l^2 (3 L - l)), l = L - offset. @throws Error when 0 <= offset < L does not hold.
double offsetFactor(double stickout, double offset);

struct ImpactOptions {
  bool window_force = true;  ///< Dunwoody eq. 4.17..4.19
  double exponential_time =
      0.0;                      ///< [s] time constant of an exponential window on force and response; 0: none
  double response_scale = 1.0;  ///< [unit of FRF x N / unit of the response] e.g. -sensitivity
  /// [V] gain of a sensor V = gain (gap0 / gap - 1): bends the response straight, v / (1 + v / (gain + V
  /// before)), so that a strong mode's second harmonic does not show as another mode; response_scale is then
  /// the slope at rest. 0: linear.
  double sensor_gain = 0.0;
  std::string unit = "m/N";  ///< of the FRF
};

/// Windows, transforms and averages hits of one point (Dunwoody eq. 4.15..4.27). Baselines before the trigger
/// are taken off. Standard deviations: with several hits from their scatter, smoothed over neighbouring lines
/// and never below what the noise before the hits gives (eq. 4.39); with one hit from that noise (eq. 4.29).
class ImpactAnalysis {
 public:
  explicit ImpactAnalysis(const ImpactOptions& options);

  /// @throws Error on another length or sample rate than the first hit's, NaN, or no positive force.
  void add(const Hit& hit);
  int hits() const { return hits_; }

  /// H1 of all hits so far. @throws Error without a hit.
  FrequencyResponse frf() const;

  /// Takes the exponential window's damping off fitted modes: zeta -= 1 / (time 2 pi f).
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

}  // namespace hammer
}  // namespace smartmill
