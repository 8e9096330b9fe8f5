#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "smartmill_focas/codec.h"

namespace smartmill::fuzz {

/// All complete frames of the bytes, which arrive in pieces.
template <class Take>
void eachFrame(const std::uint8_t* data, std::size_t size, const Take& take) {
  focas::FrameReader reader;
  try {
    for (std::size_t at = 0; at < size;) {
      const std::size_t piece = std::min<std::size_t>(size - at, 1 + data[at] % 32);
      reader.append(data + at, piece);
      at += piece;
      while (const std::optional<focas::Frame> frame = reader.next()) {
        take(*frame);
      }
    }
  } catch (const focas::WireError&) {
    // Not FOCAS.
  }
}

}  // namespace smartmill::fuzz
