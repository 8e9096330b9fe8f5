#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

#include "smartmill_core/signal/stream_sorter.h"
#include "smartmill_loadmeter/identification/identification.h"

namespace smartmill::loadmeter {

/// Puts the streams into stamp order and passes them to LoadMeterIdentification; used by the node and for
/// bags.
class IdentificationPipeline {
 public:
  /// @param hold_back [s], see StreamSorter. @throws Error as LoadMeterIdentification.
  IdentificationPipeline(const MachineModel& model, const IdentificationParameters& parameters,
                         double hold_back);

  /// Callbacks run inside push() and flush().
  LoadMeterIdentification& identification() { return identification_; }

  void push(const CncState& state) { sort(states_, state); }
  void push(const LoadSample& sample) { sort(loads_, sample); }
  /// machine/temperature: readings in seconds, not waited for longer than the hold-back.
  void push(const MachineTemperature& temperature) { sort(temperatures_, temperature); }
  /// daq/motor_current: optional; waited for like the others after its first block.
  void push(const SampleBlock& block) { sort(motors_, block); }
  /// force/compensated: optional, likewise.
  void push(const ForceBlock& block) { sort(forces_, block); }
  void push(const CuttingCondition& condition) { sort(conditions_, condition); }
  void push(const IdentifyGoal& goal) { sort(goals_, goal); }
  /// inspection/feature: of a cut long past, with the time of its inspection: not ordered with the streams.
  void push(const InspectionFeature& feature) { identification_.handle(feature); }

  /// End of data: passes on everything that waits.
  void flush() { sorter_.flush(); }

  double newest() const { return newest_; }  ///< [s] newest stamp; 0: none
  std::size_t late() const { return sorter_.late(); }
  std::string waitingFor() const { return sorter_.waitingFor(); }

 private:
  template <typename Input>
  void sort(StreamSorter::Stream stream, const Input& input) {
    sorter_.push(stream, input.stamp, [this, input] { identification_.handle(input); });
    newest_ = std::max(newest_, input.stamp);
  }

  LoadMeterIdentification identification_;
  StreamSorter sorter_;
  StreamSorter::Stream states_, loads_, temperatures_, motors_, forces_, conditions_, goals_;
  double newest_ = 0.0;
};

}  // namespace smartmill::loadmeter
