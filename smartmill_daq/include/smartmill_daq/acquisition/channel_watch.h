#pragma once

#include <cstdint>

#include "smartmill_daq/acquisition/fault_log.h"
#include "smartmill_daq/instrument/instrument.h"

namespace smartmill::daq {

/// Level of a channel over the last second.
struct ChannelLevel {
  double mean = 0.0, rms = 0.0;                                    ///< [unit] rms about the mean
  double peak = 0.0;                                               ///< [1] largest share of the range
  std::uint64_t clipped = 0, stuck = 0, bias = 0, not_finite = 0;  ///< [1] samples since the start
  bool faulty = false;                                             ///< the last sample was marked
};

/// Turns the raw values of a channel into its unit and marks those that are no measurement as NaN: at the end
/// of the range, repeated for too long, without supply of the sensor, not a number.
class ChannelWatch {
 public:
  ChannelWatch(Channel channel, double sample_rate, bool share_of_range);

  /// Before the samples of a batch. @param overloaded, bias_fault reported by the device
  void beginBatch(double time, bool overloaded, bool bias_fault);
  /// @param index running index of the sample @return [unit], or NaN
  double value(double raw, std::uint64_t index, FaultLog& log);

  const ChannelLevel& level() const { return level_; }
  const Channel& channel() const { return channel_; }

 private:
  /// A fault of one kind: begins with its first sample and ends when QUIET samples were good.
  struct Event {
    std::uint64_t until = 0;  // running index up to which it lasts
  };
  template <class Text>
  void mark(FaultKind kind, Event& event, std::uint64_t index, std::uint64_t& count, const Text& text,
            FaultLog& log);
  void addToLevel(double value, double share);

  Channel channel_;
  double scale_, share_;                            // [unit] and [1] per raw
  double offset_;                                   // [unit]
  std::uint64_t quiet_, stuck_after_ = 0, window_;  // [1] samples
  double time_ = 0.0;
  bool overloaded_ = false, bias_fault_ = false;
  double last_ = 0.0;
  std::uint64_t run_ = 0;  // samples equal to the last one
  Event clipping_, stuck_, bias_, not_finite_;
  double sum_ = 0.0, squares_ = 0.0, peak_ = 0.0, first_ = 0.0;
  std::uint64_t count_ = 0, good_ = 0;
  ChannelLevel level_;
};

}  // namespace smartmill::daq
