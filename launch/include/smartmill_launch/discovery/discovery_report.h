#pragma once

#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_launch/discovery/explained.h"

namespace smartmill::discovery {

/// Result of a discovery, compared with the hidden effects of a simulated machine.
struct DiscoveryReport {
  std::string text;       ///< Markdown
  bool named = false;     ///< the named effects are exactly the hidden ones
  bool improved = false;  ///< the held-out gap fell
};

/// @param tests suggested tests, as in the result of the action @param hidden effects of the machine; empty:
/// unknown
DiscoveryReport reportOf(const Explained& explained, const std::vector<std::string>& tests,
                         const std::vector<EffectEntry>& hidden);

}  // namespace smartmill::discovery
