#pragma once

#include <functional>
#include <string>

#include "smartmill_core/signal/stream_sorter.h"
#include "smartmill_hammer/sequence/hammer_sequence.h"

namespace smartmill {
namespace hammer {

/// A HammerSequence behind a StreamSorter: what node and offline tool both feed, so that the same streams
/// give the same result. A jump back of time starts it afresh.
class HammerPipeline {
 public:
  struct Outputs {
    std::function<void(const Command&)> command;
    std::function<void(const Feedback&)> feedback;
    std::function<void(const MeasureFrfResult&)> result;
    std::function<void()> restarted;
  };

  /// @param hold_back [s], see StreamSorter. @throws Error as HammerSequence.
  HammerPipeline(const HammerParameters& parameters, const MachineModel& model, double hold_back,
                 Outputs outputs);

  void push(const SampleBlock& hammer);
  void push(const CncState& state);
  void push(const SpindleAngle& angle);
  /// @param begin called at the goal's turn with whether no measurement runs; false: leave it. Absent: begin.
  void push(const MeasureFrfGoal& goal, std::function<bool(bool free)> begin = {});

  /// @param due asked at its turn: is the measurement still the one meant?
  void cancel(std::function<bool()> due);
  void commandFailed(const std::string& text);
  /// A stream has died: ends at once.
  void lost(const std::string& text);
  void flush() { sorter_.flush(); }  ///< end of data

  bool measuring() const { return sequence_.active(); }
  std::size_t late() const { return sorter_.late(); }
  std::string waitingFor() const { return sorter_.waitingFor(); }

 private:
  template <class Input>
  void sort(StreamSorter::Stream stream, const Input& input);
  void drain();

  HammerSequence sequence_;
  Outputs outputs_;
  StreamSorter sorter_;
  // In this order: equal stamps come out in it.
  StreamSorter::Stream events_, blocks_, states_, angles_;
};

}  // namespace hammer
}  // namespace smartmill
