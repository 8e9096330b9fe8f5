#include "smartmill_program/plan/feed_limits.h"

#include <array>
#include <cmath>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/require.h"

namespace smartmill::program {

const char* nameOf(FeedLimit limit) {
  constexpr std::array<const char*, FEED_LIMITS> NAMES{"none",         "force",        "torque",
                                                       "power",        "chip",         "feed per tooth",
                                                       "machine feed", "acceleration", "no force model"};
  return NAMES[static_cast<std::size_t>(limit)];
}

void FeedLimits::validate() const {
  for (const auto& [name, value] : {std::pair<const char*, double>{"limit of the force", force},
                                    {"limit of the torque", torque},
                                    {"limit of the power", power},
                                    {"limit of the chip thickness", chip},
                                    {"limit of the feed per tooth", feed_per_tooth},
                                    {"limit of the machine's feed", machine},
                                    {"limit of the acceleration", acceleration}})
    if (value != UNLIMITED) require(name, value, Range::positive());
  require("least chip thickness", least_chip, Range::notNegative(), "m");
  if (std::isinf(chip) && std::isinf(feed_per_tooth))
    throw Error(
        "a feed plan without a limit of the chip thickness or the feed per tooth, expected one of them");
  if (std::isinf(machine)) throw Error("a feed plan without a largest feed of the machine, expected one");
}

}  // namespace smartmill::program
