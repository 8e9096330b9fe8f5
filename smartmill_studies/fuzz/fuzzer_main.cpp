// Entry point for libFuzzer; the macro FUZZ_TARGET selects the target (.ci/fuzz).
#include "fuzz/targets.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  smartmill::fuzz::FUZZ_TARGET(data, size);
  return 0;
}
