#include "fuzz/targets.h"
#include "smartmill_focas/describe.h"
#include "smartmill_focas/recording.h"

namespace smartmill::fuzz {

void recording(const std::uint8_t* data, std::size_t size) {
  try {
    for (const focas::RecordedFrame& frame :
         focas::parseRecording({reinterpret_cast<const char*>(data), size}, "fuzzed")) {
      focas::describe(frame);
    }
  } catch (const focas::WireError&) {
    // The error states file and line.
  }
}

}  // namespace smartmill::fuzz
