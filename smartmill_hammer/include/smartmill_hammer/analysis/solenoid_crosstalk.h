#pragma once

#include "smartmill_core/signal/hit.h"

namespace smartmill::hammer {

/// Subtracts the crosstalk of the solenoid's current from both channels of a hit: constant until contact,
/// then decaying with one time constant, which is fitted to the force after the contact. Its size is the
/// difference between the level before contact and that at the record's end. One within the noise, or larger
/// than `largest_share` of the channel's peak, is no crosstalk and is left unchanged.
/// @param largest_share [1] 0: no correction
void removeSolenoidCrosstalk(Hit& hit, double largest_share);

}  // namespace smartmill::hammer
