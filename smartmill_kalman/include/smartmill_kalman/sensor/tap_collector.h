#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "smartmill_core/signal/hit_collector.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_kalman/sensor/sensor_measurement.h"
#include "smartmill_kalman/sensor/tap_pairs.h"

namespace smartmill::kalman {

/// Records of all channels of a force sensor at the hits of a tap test; SensorMeasurement decides which
/// count.
class TapCollector {
 public:
  TapCollector(const TapParameters& taps, std::size_t channels);

  void begin();
  void end();
  bool active() const { return active_; }
  /// Block of the hammer (channel hammer [N]). @throws Error when the channel is missing.
  void handleHammer(const SampleBlock& block);
  /// One sample of all channels. @param time [s] @param index running index @param rate [Hz]
  void add(double time, std::uint64_t index, double rate, std::vector<double> values);
  /// Accepted hits of the measurement, each with one record per channel.
  std::vector<std::vector<Hit>> acceptedHits(const SensorResult& result) const;
  double rate() const { return rate_; }  ///< [Hz] of the last hit; 0 before

 private:
  void handlePairs();

  bool active_ = false;
  double rate_ = 0.0;
  TapPairs pairs_;
  std::vector<HitCollector> collectors_;
  std::vector<std::vector<Hit>> hits_;
};

}  // namespace smartmill::kalman
