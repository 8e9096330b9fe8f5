#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/chatter/chatter_detector.h"

namespace smartmill::stability {

/// Streams of a machine in one straight steady cut, in addition to the force.
class CutStreams {
 public:
  /// @param speed [rad/s] @param states_from [s] stamp of the first controller state
  CutStreams(ChatterDetector& detector, double speed, const ToolGeometry& tool, double states_from = 0.0)
      : detector_(detector), speed_(speed), next_state_(states_from) {
    CuttingCondition condition;
    condition.kind = CuttingCondition::Kind::cut;
    condition.name = "cut";
    condition.tool = tool;
    condition.steady_from = {{0.0, 0.0, 0.0}};
    condition.steady_to = {{1.0, 0.0, 0.0}};
    detector_.handle(condition);
  }

  /// Passes spindle angle and controller state to the detector in their periods; called with ascending time
  /// [s].
  /// @param in_stock whether the tool is in the steady part of the cut
  void at(double time, bool in_stock) {
    if (time >= next_angle_) {
      detector_.handle(SpindleAngle{time, std::fmod(speed_ * time, units::TWO_PI), speed_});
      next_angle_ += 0.005;
    }
    if (time < next_state_) return;
    CncState state;
    state.stamp = time;
    state.connected = true;
    state.axes = {"X", "Y", "Z"};
    state.position = {in_stock ? 0.5 : 2.0, 0.0, 0.0};
    state.distance_to_go = {0.0, 0.0, 0.0};
    state.feed = 0.02;
    detector_.handle(state);
    next_state_ += 0.02;
  }

 private:
  ChatterDetector& detector_;
  double speed_;
  double next_angle_ = 0.0, next_state_;  // [s]
};

/// [Hz] Strongest line of all channels without the part that repeats with a period.
/// @param signal whole periods @param period in samples @param rate [Hz]
inline double strongestLine(std::vector<std::vector<double>> signal, std::size_t period, double rate) {
  const std::size_t count = signal.front().size();
  std::vector<double> power(count / 2 + 1, 0.0);
  for (std::vector<double>& channel : signal) {
    const double turns = static_cast<double>(count / period);
    for (std::size_t b = 0; b < period; ++b) {
      double mean = 0.0;
      for (std::size_t k = b; k < count; k += period) mean += channel[k] / turns;
      for (std::size_t k = b; k < count; k += period) channel[k] -= mean;
    }
    const auto spectrum = fourier(channel);
    for (std::size_t k = 0; k < power.size(); ++k) power[k] += std::norm(spectrum[k]);
  }
  const auto peak = std::max_element(power.begin() + 1, power.end()) - power.begin();
  return static_cast<double>(peak) * rate / static_cast<double>(count);
}

}  // namespace smartmill::stability
