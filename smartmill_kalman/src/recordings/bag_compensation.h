#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "node/parameters.h"
#include "smartmill_core/signal/pulse_tachometer.h"
#include "smartmill_kalman/compensation/record_compensation.h"

namespace smartmill::kalman {

/// Force on the tool in one cut of a bag, machine frame.
struct BagCut {
  std::string name;            ///< of the cutting condition
  double stamp = 0.0;          ///< [s] of the cutting condition
  double sample_rate = 0.0;    ///< [Hz]
  double speed = 0.0;          ///< [rad/s] of the spindle, last
  std::string force_model;     ///< last one, where it is not the default; empty: the default
  double settling = 0.0;       ///< [s] marked as settling or passed through
  std::vector<double> offset;  ///< [s] of each sample since stamp
  std::array<std::vector<double>, 3> measured, compensated;  ///< [N]
};

/// Contents of a bag besides its cuts.
struct BagSummary {
  std::size_t cuts = 0, gaps = 0, not_finite = 0, late = 0;
  bool rotation_known = false;           ///< false: no transform, forces are in the sensor's frame
  double duration = 0.0;                 ///< [s]
  std::vector<SensorResult> identified;  ///< tap tests in the bag
  /// Pulses of daq/tachometer, where the bag has no spindle/angle; nothing: it has.
  std::optional<PulseTachometer::Counts> pulses;
  std::string tachometer_fault;  ///< the last one; empty: none
};

/// Feeds a bag's sensors, conditions and goals to CompensationPipeline, as the node does. Methods that need
/// the whole record then run on each cut, with the sensor and the speed of the pipeline.
/// @param tachometer of daq/tachometer, for a bag without spindle/angle @param done called at the end of each
/// cut, in order @throws Error.
BagSummary compensateBag(const std::string& path, const ForceSensor& sensor, const NodeParameters& parameters,
                         Method method, const PulseTachometerParameters& tachometer,
                         const std::function<void(BagCut&&)>& done,
                         const std::function<void(double)>& progress = {});

}  // namespace smartmill::kalman
