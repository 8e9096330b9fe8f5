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

/// What a machine says beside the force while it makes one straight steady cut.
class CutStreams {
 public:
  /// @param speed [rad/s] @param states_from [s] the controller says nothing before
  CutStreams(ChatterDetector& detector, double speed, const ToolGeometry& tool, double states_from = 0.0)
      : detector_(detector), speed_(speed), state_due_(states_from) {
    CuttingCondition condition;
    condition.kind = CuttingCondition::Kind::cut;
    condition.name = "cut";
    condition.tool = tool;
    condition.steady_from = {{0.0, 0.0, 0.0}};
    condition.steady_to = {{1.0, 0.0, 0.0}};
    detector_.handle(condition);
  }

  /// Angle and controller's state when they are due, in order of time [s]. @param in_stock the tool is in the
  /// steady part of the cut
  void at(double time, bool in_stock) {
    if (time >= angle_due_) {
      detector_.handle(SpindleAngle{time, std::fmod(speed_ * time, units::TWO_PI), speed_});
      angle_due_ += 0.005;
    }
    if (time < state_due_) return;
    CncState state;
    state.stamp = time;
    state.connected = true;
    state.axes = {"X", "Y", "Z"};
    state.position = {in_stock ? 0.5 : 2.0, 0.0, 0.0};
    state.distance_to_go = {0.0, 0.0, 0.0};
    state.feed = 0.02;
    detector_.handle(state);
    state_due_ += 0.02;
  }

 private:
  ChatterDetector& detector_;
  double speed_;
  double angle_due_ = 0.0, state_due_;  // [s]
};

/// [Hz] strongest line of all channels beside what repeats with a period of so many samples.
/// @param signal whole periods @param rate [Hz]
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
