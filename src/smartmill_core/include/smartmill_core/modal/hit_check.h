#pragma once

#include <vector>

#include "smartmill_core/modal/hit_limits.h"
#include "smartmill_core/signal/hit.h"

namespace smartmill {

struct HitCheckOptions {
  double weak_force = 0.0;        ///< [N] a lower peak is a weak hit; 0: limit from the force's noise
  double second_hit_share = 0.1;  ///< [1] of the peak; a larger second rise of the force is a second hit
  double response_range = 0.0;    ///< [unit of the response] a response reaching it is clipped; 0: unknown
  double high = 0.0;              ///< [Hz] the force must have power up to here; 0: not checked
  HitLimits limits = {};
};

/// Fault of a single recorded hit: weak or dull, double from 0.5 ms on, clipped, stuck, with dropouts, a
/// drifting baseline or a late bump. Live and offline measurements share this rule.
HitFault hitFault(const Hit& hit, const HitCheckOptions& options);

/// Faults of hits relative to the other hits: a different gain, or a shift between the channels. Each hit's
/// FRF is compared with that of all others where the force is strong; needs three hits. One entry per hit.
/// @param usable hits that take part
std::vector<HitFault> faultsAmongHits(const std::vector<Hit>& hits, const std::vector<bool>& usable,
                                      const HitComparisonLimits& limits = {});

/// hitFault(), then faultsAmongHits(); one entry per hit.
std::vector<HitFault> checkHits(const std::vector<Hit>& hits, const HitCheckOptions& options);

}  // namespace smartmill
