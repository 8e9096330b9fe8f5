#pragma once

#include <algorithm>
#include <vector>

#include "smartmill_core/signal/streams.h"
#include "smartmill_stability_testing/kim_case.h"

namespace smartmill::stability {

/// Displacement streams of an uncontrolled run of a process in blocks. @param size samples in a block
inline std::vector<SampleBlock> displacementBlocks(const TurningProcess& process, double duration,
                                                   std::size_t size) {
  const TurningRun run = simulateTurning(process, duration, CONTROL_RATE, 0.0, 1, {});
  std::vector<SampleBlock> blocks;
  for (std::size_t i = 0; i < run.time.size(); i += size) {
    SampleBlock block;
    block.stamp = 100.0 + run.time[i];
    block.sample_rate = CONTROL_RATE;
    block.first_index = i;
    block.channels = {"deflection", "tool"};
    block.units = {"m", "m"};
    for (std::size_t k = i; k < std::min(i + size, run.time.size()); ++k) {
      block.samples.push_back(run.deflection[k]);
      block.samples.push_back(0.0);
    }
    blocks.push_back(block);
  }
  return blocks;
}

}  // namespace smartmill::stability
