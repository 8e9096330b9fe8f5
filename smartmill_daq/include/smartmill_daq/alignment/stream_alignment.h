#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/signal/stream_shift.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::daq {

/// A signal of a stream: "TOPIC/CHANNEL" of sample blocks, or "cnc/state/AXIS", the position of an axis as
/// the controller reports it.
struct SignalName {
  std::string topic, channel;

  /// @throws Error when there is no slash
  explicit SignalName(const std::string& text);
  bool ofController() const;
  std::string text() const { return topic + "/" + channel; }
};

enum class AlignmentMethod {
  taps,    ///< onsets of taps that both sensors see
  motion,  ///< a force or acceleration against the acceleration of the controller's axis: start of an air cut
  correlation  ///< cross-correlation of both signals
};
const char* methodName(AlignmentMethod method);

struct Alignment {
  AlignmentMethod method = AlignmentMethod::taps;
  StreamShift shift;
};

struct AlignmentOptions {
  double window = 10.0;  ///< [s] of a record: a tap or the start of an air cut fits in, its rest stays short
  double range = 1.0;    ///< [s] searched to either side
  std::optional<AlignmentMethod> only;  ///< no other method
};

/// Shift of two records of about the same times, by the first method that shows one: taps, motion,
/// correlation. With a position of the controller by motion only.
std::optional<Alignment> align(const SampledSignal& late, const SampledSignal& early, bool early_is_position,
                               const AlignmentOptions& options);

/// Shift between two streams, estimated record by record and combined by the inverse variances; its standard
/// deviation contains the scatter between records (R. T. Birge, Phys. Rev. 40, 1932), to which the clocks of
/// the devices add. Begins anew where a record contradicts. Time is that of the stamps.
class StreamAlignment {
 public:
  /// @throws Error when the late signal is one of the controller, or the early one none of its axes
  StreamAlignment(SignalName late, SignalName early, const AlignmentOptions& options = {});

  void push(const std::string& topic, const SampleBlock& block);
  void push(const CncState& state);
  /// Evaluates what is left of a recording.
  void finish();

  /// By what is known so far. events: of all records.
  const std::optional<Alignment>& state() const { return state_; }
  std::size_t records() const { return records_; }  ///< [1] evaluated
  std::size_t shown() const { return shown_; }      ///< [1] in which the shift shows
  /// One line when a record has contradicted those before it; empty: none since the last call.
  std::string takeChange();

  const SignalName& late() const { return late_; }
  const SignalName& early() const { return early_; }

 private:
  class Window {
   public:
    void push(const SampleBlock& block, const std::string& channel);
    void push(double stamp, double value);
    double length() const;
    SampledSignal signal() const;
    void clear();

   private:
    double begin_ = 0.0, rate_ = 0.0;
    std::uint64_t next_index_ = 0;
    std::vector<double> times_;  // [s] of values without a rate
    std::vector<double> values_;
  };
  void evaluateIfFull();
  void evaluate();
  void combine(const Alignment& found);

  SignalName late_, early_;
  AlignmentOptions options_;
  Window late_window_, early_window_;
  std::optional<Alignment> state_;
  std::array<double, 4> sums_{};  // of the records: number, weights, weighted shifts and their squares
  std::size_t records_ = 0, shown_ = 0;
  std::string change_;
};

/// "daq/hammer/hammer is 12.500 ms (sd 0.030) later than daq/dynamometer/fx, by taps (4)".
std::string alignmentText(const StreamAlignment& alignment);

/// Adds a shift to `latency` of an instrument file, with `latency_std`; the rest, comments included, stays.
/// @return [s] the new latency @throws Error when it would be negative, or "FILE: what"
double storeLatency(const std::string& file, const StreamShift& shift);

}  // namespace smartmill::daq
