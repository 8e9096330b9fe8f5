#pragma once

#include <cstdint>
#include <vector>

#include "smartmill_stability/chatter/sound_listener.h"
#include "stability/sound_scenes.h"

namespace smartmill::stability {

/// Streams the sound of a scene to a listener as a microphone does, and does its work.
/// @param stream index of the first sample; continued
void listenTo(const SoundScene& scene, SoundListener& listener, std::uint64_t& stream);

/// Cuts of one machine at one depth, at the speeds that the listener proposes.
struct SoundSession {
  struct Cut {
    SoundScene scene;  ///< without its sound
    SoundTry heard;    ///< its last one; kind no_cut: none
  };
  std::vector<Cut> cuts;  ///< the first one chatters
  bool stable = false;    ///< the last one is, by the simulation and by ear
};

/// @param depth [m] @param first [rad/s] speed of a cut that chatters @param most cuts after the first
SoundSession runSoundSession(const MachineModel& model, const RegenerativeSystem& system,
                             const SpeedRange& range, double depth, double first, unsigned seed, int most);

/// A speed and a depth at which a cut chatters while others of the range are stable: a fifth of them at
/// least.
/// @throws Error if there is none.
struct FirstCut {
  double speed = 0.0, depth = 0.0;  ///< [rad/s], [m]
};
FirstCut drawFirstCut(const RegenerativeSystem& system, const SpeedRange& range, double max_depth,
                      unsigned seed);

}  // namespace smartmill::stability
