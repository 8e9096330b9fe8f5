#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "smartmill_sim/twin/cutting_parts.h"

namespace smartmill::sim {

/// Simulates many steps stage by stage, see CuttingMachine::run().
class StageRun {
 public:
  using Next = std::function<void(std::size_t, CuttingInput&)>;

  /// @param parts must outlive the run
  explicit StageRun(CuttingParts& parts)
      : parts_(parts), cut_(parts.cut), effects_(parts.timeline.effects()) {}

  void run(std::size_t steps, const Next& next, const ChannelRows& raw);

 private:
  struct History : ForceHistory {
    std::vector<Instant> instants;  // where effects need them
  };
  void simulateCut(std::size_t steps, const Next& next, const ChannelRows& raw, History& history);
  bool replaysWithoutUpdates() const;
  void applyOutputEffects(const std::vector<Instant>& instants, const ChannelRows& raw) const;

  CuttingParts& parts_;
  FlexibleCut& cut_;
  const EffectSet& effects_;
};

}  // namespace smartmill::sim
