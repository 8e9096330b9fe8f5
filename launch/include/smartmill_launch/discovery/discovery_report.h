#pragma once

#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_launch/discovery/explained.h"

namespace smartmill::discovery {

/// What a discovery found, beside what the machine hides where that is known.
struct DiscoveryReport {
  std::string text;       ///< Markdown
  bool named = false;     ///< exactly the hidden effects were named
  bool improved = false;  ///< the held-out gap fell
};

/// @param tests that were asked for, as the action says them @param hidden the machine's effects
DiscoveryReport reportOf(const Explained& explained, const std::vector<std::string>& tests,
                         const std::vector<EffectEntry>& hidden);

}  // namespace smartmill::discovery
