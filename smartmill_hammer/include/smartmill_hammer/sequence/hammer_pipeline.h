#pragma once

#include <functional>
#include <string>

#include "smartmill_core/signal/stream_sorter.h"
#include "smartmill_hammer/sequence/hammer_sequence.h"

namespace smartmill::hammer {

/// A HammerSequence behind a StreamSorter, for node and offline tool alike: the same streams give the same
/// result. A backward jump of time resets it.
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
  /// @param begin called when the goal's turn has come, with whether no measurement runs; false: the goal is
  /// discarded. Absent: it begins.
  void push(const MeasureFrfGoal& goal, std::function<bool(bool free)> begin = {});

  /// @param applies called when the request's turn has come: whether it still applies to the measurement
  void cancel(std::function<bool()> applies);
  void commandFailed(const std::string& text);
  /// A stream has ended: the measurement ends at once.
  void inputLost(const std::string& text);
  void flush() { sorter_.flush(); }  ///< end of data

  bool isMeasuring() const { return sequence_.isActive(); }
  std::size_t lateMessages() const { return sorter_.late(); }
  std::string waitingFor() const { return sorter_.waitingFor(); }

 private:
  template <class Input>
  void sort(StreamSorter::Stream stream, const Input& input);
  void drain();

  HammerSequence sequence_;
  Outputs outputs_;
  StreamSorter sorter_;
  // Equal stamps are passed on in this order.
  StreamSorter::Stream events_, blocks_, states_, angles_;
};

}  // namespace smartmill::hammer
