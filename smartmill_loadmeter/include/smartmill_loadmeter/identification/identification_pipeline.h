#pragma once

#include <cstddef>
#include <limits>
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

  void push(const CncState& state);
  void push(const LoadSample& sample);
  /// daq/motor_current: optional; waited for like the others after its first block.
  void push(const SampleBlock& block);
  /// force/compensated: optional, likewise.
  void push(const ForceBlock& block);
  void push(const CuttingCondition& condition);
  void push(const IdentifyGoal& goal);

  /// End of data: passes on everything that waits.
  void flush() { sorter_.flush(); }

  double newest() const { return newest_; }  ///< [s] newest stamp; 0: none
  std::size_t late() const { return sorter_.late(); }
  std::string waitingFor() const { return sorter_.waitingFor(); }

 private:
  template <typename Input>
  void sort(StreamSorter::Stream stream, const Input& input);

  LoadMeterIdentification identification_;
  StreamSorter sorter_;
  StreamSorter::Stream states_, loads_, motors_, forces_, conditions_, goals_;
  double newest_ = 0.0;
};

}  // namespace smartmill::loadmeter
