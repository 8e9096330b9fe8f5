#pragma once

#include <vector>

#include "smartmill_core/signal/hit.h"

namespace smartmill {

struct HitCheckOptions {
  double weak_force = 0.0;        ///< [N] a lower peak is a weak hit; 0: told by the force's noise
  double second_hit_share = 0.1;  ///< [1] of the peak, from which a second rise of the force is a second hit
  double response_range = 0.0;    ///< [unit of the response] a response reaching it is clipped; 0: unknown
  double high = 0.0;              ///< [Hz] the force must have power up to here; 0: not asked
};

/// Why a recorded hit cannot be used, by itself: weak or dull, double from 0.5 ms on, clipped, stuck, with
/// dropouts, with a drifting baseline, with a late bump. One rule for all who strike, live and offline.
HitFault hitFault(const Hit& hit, const HitCheckOptions& options);

/// Why hits cannot be used beside the others: another gain, or a shift between the channels. Compared is each
/// hit's FRF with that of all others where the force is strong; needs three hits. One a hit.
/// @param usable hits that take part
std::vector<HitFault> faultsBeside(const std::vector<Hit>& hits, const std::vector<bool>& usable);

/// Both, one a hit.
std::vector<HitFault> judgeHits(const std::vector<Hit>& hits, const HitCheckOptions& options);

}  // namespace smartmill
