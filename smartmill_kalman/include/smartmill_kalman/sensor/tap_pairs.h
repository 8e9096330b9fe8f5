#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/signal/streams.h"

namespace smartmill::kalman {

/// Samples of the hammer and of the force sensor at the same times. One instrument samples both: samples with
/// the same running index were taken together. A sample that one stream has lost is a gap in the index of the
/// pairs.
class TapPairs {
 public:
  struct Pair {
    double time = 0.0;        ///< [s]
    std::uint64_t index = 0;  ///< running index of the instrument
    double rate = 0.0;        ///< [Hz]
    double force = 0.0;       ///< [N] of the hammer
    std::vector<double> response;
  };

  /// @param patience [s] > 0 for which one stream waits for the other
  explicit TapPairs(double patience);

  /// Block of the hammer (channel hammer [N]). @throws Error when the channel is missing.
  void addHammer(const SampleBlock& block);
  /// One sample of the force sensor.
  void addResponse(double time, std::uint64_t index, double rate, std::vector<double> values);
  /// The next pair, once. No value while a stream waits for the other one, and after a fault.
  std::optional<Pair> next();
  /// Why the streams cannot be paired; empty: they can.
  const std::string& fault() const { return fault_; }
  void clear();

 private:
  struct Sample {
    double time;
    std::uint64_t index;
    double rate;
    std::vector<double> values;
  };
  void checkPatience();

  double patience_;  // [s]
  std::deque<Sample> hammer_, response_;
  std::string fault_;
};

}  // namespace smartmill::kalman
