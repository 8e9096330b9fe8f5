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

/// Every value of a model that the record of a test of this kind depends on; two models with the same values
/// give the same record. @param model of effects that the catalogue knows
std::vector<double> valuesOfRecord(const MachineModel& model, TestKind kind);

/// Whether each channel of a record shows what no other one has a part in (cross talk mixes them).
bool channelsApart(const MachineModel& model);

/// As valuesOfRecord(), of one channel (ChannelIndex) of a record whose channels are apart.
std::vector<double> valuesOfChannel(const MachineModel& model, TestKind kind, std::size_t channel);

/// The same of what cut and tool do in it (CutTrace). @param guided CuttingMachine::guide()
std::vector<double> valuesOfTrace(const MachineModel& model, TestKind kind, bool guided);

/// What cut and tool did in one test, for the last few models: most models of a search differ from the one
/// before them in what comes after. For many threads.
class CutTraces {
 public:
  /// @param most >= 1 that are held
  explicit CutTraces(std::size_t most) : most_(most) {}

  /// @return nullptr: not held
  std::shared_ptr<const CutTrace> find(const std::vector<double>& values);
  void hold(std::vector<double> values, std::shared_ptr<const CutTrace> trace);
  void clear();

 private:
  std::size_t most_;
  std::mutex mutex_;
  std::deque<std::pair<std::vector<double>, std::shared_ptr<const CutTrace>>> held_;  // newest use first
};

}  // namespace smartmill::sim
