#pragma once

#include <cstddef>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::kalman {

/// Column of a channel. @throws Error when the channel is missing or in another unit.
inline std::size_t columnOf(const SampleBlock& block, const std::string& channel, const std::string& unit) {
  const std::size_t column = block.channel(channel);
  if (block.units.at(column) == unit) return column;
  throw Error("sample block: channel " + channel + ": unit '" + block.units[column] + "', expected '" + unit +
              "'");
}

}  // namespace smartmill::kalman
