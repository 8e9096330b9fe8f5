#include <cstdlib>
#include <string>

#include "fuzz/targets.h"
#include "smartmill_cnc/linuxcnc/protocol.h"
#include "smartmill_core/error.h"

namespace smartmill::fuzz {
namespace {

using namespace cnc::linuxcnc;

/// An accepted frame is decoded to the same content after encoding.
void roundTrip(const Received& received) {
  const std::string bytes = encode(received.message, received.sequence);
  FrameDecoder decoder;
  decoder.push(bytes.data(), bytes.size());
  const std::optional<Received> again = decoder.next();
  if (!again || encode(again->message, again->sequence) != bytes) {
    std::abort();
  }
}

}  // namespace

void gateway(const std::uint8_t* data, std::size_t size) {
  FrameDecoder decoder;
  const char* bytes = reinterpret_cast<const char*>(data);
  try {
    for (std::size_t at = 0; at < size;) {
      const std::size_t piece = std::min<std::size_t>(size - at, 1 + data[at] % 64);
      decoder.push(bytes + at, piece);
      at += piece;
      while (const std::optional<Received> received = decoder.next()) {
        roundTrip(*received);
      }
    }
  } catch (const Error&) {
    // Its connection is closed.
  }
}

}  // namespace smartmill::fuzz
