#pragma once

#include <cstdint>
#include <random>
#include <string>

#include "smartmill_core/model/machine_model.h"

namespace smartmill {

/// A rectangular pocket that is open towards -x: a slot and rings of three lines around it, in the dialect of
/// the bridge and the machine's coordinates. The simulated machine's tool cannot enter the material from
/// above.
struct PocketTraits {
  int levels = 2, rings = 4;
  double depth = 1e-3;                            ///< [m] of a level
  double slot = 0.06;                             ///< [m] length of the slot's way in the stock
  double step = 0.4;                              ///< [1] radial depth of a ring over the diameter
  double speed = 420.0;                           ///< [rad/s]
  double least_feed = 5e-5, largest_feed = 2e-4;  ///< [m] per tooth, from the outermost ring to the slot
};

/// Draws sizes, speed and feeds.
PocketTraits drawPocket(std::mt19937_64& random);

/// The same; a level is at most 0.7 times as deep as the stability limit of the slot.
PocketTraits drawStablePocket(std::mt19937_64& random, const MachineModel& machine);

/// @throws Error when the pocket does not fit the model's workpiece
std::string pocketProgram(const PocketTraits& traits, const MachineModel& model);

}  // namespace smartmill
