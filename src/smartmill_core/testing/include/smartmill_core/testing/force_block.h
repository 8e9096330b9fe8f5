#pragma once

#include <cstdint>

#include "smartmill_core/signal/force_channels.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill {

/// Block of a force sensor without its samples. @param stamp [s] @param rate [Hz] @param index running index
inline SampleBlock forceBlock(double stamp, double rate, std::uint64_t index) {
  SampleBlock block;
  block.stamp = stamp;
  block.sample_rate = rate;
  block.first_index = index;
  block.channels.assign(FORCE_CHANNELS.begin(), FORCE_CHANNELS.end());
  block.units = {"N", "N", "N"};
  return block;
}

}  // namespace smartmill
