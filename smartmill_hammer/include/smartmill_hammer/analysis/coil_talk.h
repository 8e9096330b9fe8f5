#pragma once

#include "smartmill_core/signal/hit.h"

namespace smartmill {
namespace hammer {

/// Takes off what the solenoid's current adds to both channels of a blow: full until the touch, then dying
/// away with one time constant, which the force tells behind the contact. Its size is the difference between
/// the level before the touch and that at the record's end; one that noise gives, or that is larger than this
/// share of the channel's largest, is left: that is no cross-talk.
/// @param most [1] 0: nothing is taken off
void removeCoilTalk(Hit& hit, double most);

}  // namespace hammer
}  // namespace smartmill
