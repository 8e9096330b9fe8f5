#pragma once

#include "hit_channel.h"
#include "smartmill_core/modal/hit_limits.h"

namespace smartmill {

/// More (nearly) equal samples at the top than a crest has: clipped by the converter or before it. With
/// coarse resolution two equal neighbours occur by chance.
/// @param both_ways a response, which is clipped on either side
bool clipped(const HitChannel& channel, bool both_ways, const ClippingLimits& limits);

}  // namespace smartmill
