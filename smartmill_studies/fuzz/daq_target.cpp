#include <algorithm>
#include <cstdlib>
#include <string>

#include "fuzz/targets.h"
#include "smartmill_core/error.h"
#include "smartmill_daq/drivers/frame.h"

namespace smartmill::fuzz {

void daq(const std::uint8_t* data, std::size_t size) {
  using smartmill::daq::Frame;
  smartmill::daq::FrameDecoder decoder;
  const char* const bytes = reinterpret_cast<const char*>(data);
  try {
    for (std::size_t at = 0; at < size;) {
      const std::size_t piece = std::min<std::size_t>(size - at, 1 + data[at] % 64);
      decoder.push(bytes + at, piece);
      at += piece;
      while (const std::optional<Frame> frame = decoder.next()) {
        // An accepted frame has the same bytes after encoding, but for the numbers that are none.
        const std::string again = encode(*frame);
        smartmill::daq::FrameDecoder second;
        second.push(again.data(), again.size());
        const std::optional<Frame> decoded = second.next();
        if (!decoded || decoded->values.size() != frame->values.size() || encode(*decoded) != again)
          std::abort();
      }
    }
  } catch (const Error&) {
    // Its connection is closed.
  }
}

}  // namespace smartmill::fuzz
