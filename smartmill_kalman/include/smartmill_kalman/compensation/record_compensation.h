#pragma once

#include <string>
#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_kalman/filter/harmonic_filter.h"

namespace smartmill::kalman {

/// How a whole record is compensated.
enum class Method {
  kalman,     ///< causal, as the node; no latency
  delay,      ///< causal with the force model F(t) = F(t - T)
  smoother,   ///< fixed interval: each force is estimated from the whole record
  fixed_lag,  ///< each force is estimated from the samples up to a lag after it
  inverse     ///< frequency-domain inversion, latency compensated
};

/// @throws Error naming the method when it is unknown.
Method methodOf(const std::string& name);
/// Names of all methods.
std::vector<std::string> methodNames();
/// Whether the method cannot run on a stream.
bool needsWholeRecord(Method method);

/// Applied force of one axis at the record's samples [N].
/// @param measured [N] @param spindle_speed [rad/s] (not used by the inverse) @param sample_rate [Hz]
/// @param lag [s] of fixed_lag
std::vector<double> compensateRecord(Method method, const std::vector<double>& measured,
                                     const ModalModel& sensor, double spindle_speed, double sample_rate,
                                     const HarmonicFilterParameters& parameters, double lag = 0.05);

/// Fixed-interval smoother. The record is split where the causal filter's innovations show an abrupt change
/// of the force (tool entry, exit).
std::vector<double> smoothRecord(const std::vector<double>& measured, const ModalModel& sensor,
                                 double spindle_speed, double sample_rate,
                                 const HarmonicFilterParameters& parameters);

}  // namespace smartmill::kalman
