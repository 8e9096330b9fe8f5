#pragma once

#include "smartmill_core/signal/hit.h"

namespace smartmill::hammer {

struct SolenoidCrosstalkOptions {
  double significant = 4.0;    ///< [std] of a difference of two levels
  double ringing_share = 0.1;  ///< [1] of the ringing amplitude that may be mistaken for a level
  double decayed_share = 0.1;  ///< [1] of its size, below which a step has decayed
  /// [s] Bounds of the current's time constant, and the value used where the force does not determine it.
  double shortest = 0.3e-3, longest = 10e-3, usual = 3e-3;
  int steps = 36;  ///< of the search between the bounds: 10 % each
};

/// Subtracts the crosstalk of the solenoid's current from both channels of a hit: constant until contact,
/// then decaying with one time constant, which is fitted to the force after the contact. Its size is the
/// difference between the level before contact and that at the record's end. One within the noise, or larger
/// than `largest_share` of the channel's peak, is no crosstalk and is left unchanged.
/// @param largest_share [1] 0: no correction
void removeSolenoidCrosstalk(Hit& hit, double largest_share, const SolenoidCrosstalkOptions& options = {});

}  // namespace smartmill::hammer
