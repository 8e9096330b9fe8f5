#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_stability/chatter/recording.h"
#include "smartmill_stability/solvers/solver.h"
#include "stability/study_range.h"

namespace smartmill::stability {

/// What is heard in a shop.
enum class SoundKind {
  idle,            ///< a spindle that turns in air: orders of its turn, a bearing, noise
  broadband,       ///< coolant and air, switched on and off
  other_machine,   ///< tones of another machine throughout, the spindle idles
  run_up,          ///< the spindle runs up, then idles
  stable,          ///< strong tooth passings, chip noise through resonances, while it cuts
  stable_tone,     ///< the same beside another machine's tones, without any air in the recording
  speed_error,     ///< stable, the spindle turns otherwise than is told
  interrupted,     ///< stable, several short cuts
  chatter,         ///< 1.2 .. 2 times the limit
  chatter_no_air,  ///< the same without any air in the recording
  chatter_shop,    ///< chatter beside another machine's tones, and another speed than told
  chatter_interrupted
};
std::vector<SoundKind> soundKinds();
const char* nameOf(SoundKind kind);

struct SoundScene {
  SoundKind kind{};
  Recording recording;
  double told_speed = 0.0;  ///< [rad/s]
  double speed = 0.0;       ///< [rad/s]
  double depth = 0.0;       ///< [m]
  bool chatters = false;    ///< the tip's motion in the simulator repeats no more
};

/// Scenes made by a generator that knows nothing of who judges them: the cut is simulated in the time domain
/// (smartmill_sim), its sound goes with the tip's acceleration through resonances of machine and room; the
/// rest is synthesised. @param speeds range of the spindle and largest depth
std::vector<SoundScene> soundScenes(const MachineModel& model, const RegenerativeSystem& system,
                                    const StudyRange& range, const std::vector<SoundKind>& kinds);

}  // namespace smartmill::stability
