#pragma once

#include <cstddef>
#include <deque>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_sim/twin/cutting_machine.h"

namespace smartmill::sim {

/// All values of a model on which the record of a test of this kind depends; two models with the same values
/// give the same record. @param model whose effects are in the catalogue
std::vector<double> valuesOfRecord(const MachineModel& model, TestKind kind);

/// Whether the channels of a record are independent of each other, i.e. no effect (as cross talk) mixes them.
bool channelsAreIndependent(const MachineModel& model);

/// As valuesOfRecord(), for one channel (ChannelIndex) of a record with independent channels.
std::vector<double> valuesOfChannel(const MachineModel& model, TestKind kind, std::size_t channel);

/// As valuesOfRecord(), for the CutTrace of the test. @param tip_prescribed whether the motion of the tip is
/// prescribed
std::vector<double> valuesOfTrace(const MachineModel& model, TestKind kind, bool tip_prescribed);

/// Cache of the CutTrace of one test for the last few models: most models of a search differ from the
/// previous one only in the stages after cut and tool. Thread-safe.
class CutTraces {
 public:
  /// @param capacity >= 1 number of traces
  explicit CutTraces(std::size_t capacity) : capacity_(capacity) {}

  /// @return nullptr: not in the cache
  std::shared_ptr<const CutTrace> find(const std::vector<double>& values);
  void insert(std::vector<double> values, std::shared_ptr<const CutTrace> trace);
  void clear();

 private:
  std::size_t capacity_;
  std::mutex mutex_;
  std::deque<std::pair<std::vector<double>, std::shared_ptr<const CutTrace>>> entries_;  // newest use first
};

}  // namespace smartmill::sim
