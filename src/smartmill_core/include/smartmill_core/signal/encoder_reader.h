#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/signal/streams.h"

namespace smartmill {

/// Channel [1] of an encoder's counter in its sample blocks.
constexpr const char* ENCODER_CHANNEL = "encoder";

struct EncoderParameters {
  double counts_per_revolution = 4096.0;  ///< [1] with all edges counted
  double zero = 0.0;                      ///< [rad] angle of tooth 1 at count 0, clockwise from +y
  bool reversed = false;                  ///< the counter decreases with a clockwise spindle
  int bits = 0;                           ///< [1] of a counter that wraps; 0: never
  double period = 1e-3;                   ///< [s] between readings: as the servo cycle of a controller
  double speed_window = 0.01;             ///< [s] over which the speed is taken
  double highest_speed = 6283.0;          ///< [rad/s] (60,000 rpm) beyond which a counter has jumped
};

/// Spindle angle from the counter channel of an encoder, sampled at the rate of a device.
class EncoderReader {
 public:
  /// @throws Error on an invalid parameter.
  explicit EncoderReader(const EncoderParameters& parameters);

  /// @return readings in time order; none over a gap, a jump of the counter or a value that is no number
  /// @throws Error when the channel is missing
  std::vector<SpindleAngle> push(const SampleBlock& block);
  /// [rad] by the resolution of a count
  double angleStd() const;
  std::size_t faults() const { return faults_; }  ///< [1] gaps, jumps, values that are no number
  /// One line on the last fault; empty: none since the last call.
  std::string takeFault();

 private:
  void restart(const std::string& fault);

  EncoderParameters parameters_;
  std::optional<std::uint64_t> next_index_;
  std::deque<double> counts_;  // unwrapped, of the speed window; the last one is the newest
  double last_raw_ = 0.0, unwrapped_ = 0.0;
  std::size_t since_reading_ = 0;
  std::size_t faults_ = 0;
  std::string fault_;
};

}  // namespace smartmill
