#pragma once

#include <string>
#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_kalman/filter/harmonic_filter.h"

namespace smartmill::kalman {

/// How a whole record is compensated.
enum class Method {
  kalman,     ///< causal, as the node does it; no latency
  delay,      ///< the same with F(t) = F(t - T) in place of harmonics
  smoother,   ///< fixed interval: every sample knows the whole record; no latency
  fixed_lag,  ///< every sample knows what comes up to a lag after it; no latency in a record
  inverse     ///< frequency-domain inversion; its latency is taken out
};

/// @throws Error naming the method when there is none of that name.
Method methodOf(const std::string& name);

/// Applied force of one axis at the record's samples [N].
/// @param measured [N] @param spindle_speed [rad/s] (not used by the inverse) @param sample_rate [Hz]
/// @param lag [s] of fixed_lag
std::vector<double> compensateRecord(Method method, const std::vector<double>& measured,
                                     const ModalModel& sensor, double spindle_speed, double sample_rate,
                                     const HarmonicFilterParameters& parameters, double lag = 0.05);

/// Fixed-interval smoother over a record whose force may set in or end inside it: the record is parted where
/// the causal filter's innovations fell out of line.
std::vector<double> smoothRecord(const std::vector<double>& measured, const ModalModel& sensor,
                                 double spindle_speed, double sample_rate,
                                 const HarmonicFilterParameters& parameters);

}  // namespace smartmill::kalman
