#include "smartmill_daq/acquisition/fault_log.h"

namespace smartmill::daq {

const char* faultName(FaultKind kind) {
  static constexpr std::array<const char*, FAULT_KINDS> NAMES{
      "gap",    "interruption", "clipping", "bias",  "stuck",    "not finite",
      "silent", "unplugged",    "rate",     "clock", "malformed"};
  return NAMES[static_cast<std::size_t>(kind)];
}

}  // namespace smartmill::daq
