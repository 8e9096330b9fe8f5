#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "smartmill_core/signal/stream_sorter.h"
#include "smartmill_loadmeter/identification/identification.h"

namespace smartmill::loadmeter {

/// LoadMeterIdentification behind the sorter: takes inputs in any order of arrival. The node and the tool
/// that reads bags both feed this class.
class IdentificationPipeline {
 public:
  /// @param hold_back [s], see StreamSorter. @throws Error as LoadMeterIdentification.
  IdentificationPipeline(const MachineModel& model, const IdentificationParameters& parameters,
                         double hold_back);

  /// Coefficients, or why there are none; callbacks run inside push() and flush().
  LoadMeterIdentification& identification() { return identification_; }

  void push(const CncState& state);
  void push(const LoadSample& sample);
  /// daq/motor_current: may be absent; from its first block on it is waited for as the others are.
  void push(const SampleBlock& block);
  /// force/compensated: likewise.
  void push(const ForceBlock& block);
  void push(const CuttingCondition& condition);
  void push(const IdentifyGoal& goal);

  /// End of data: everything left, in order.
  void flush() { sorter_.flush(); }

  double newest() const { return newest_; }  ///< [s] newest stamp seen; 0 before any
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
