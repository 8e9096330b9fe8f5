#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_stability/chatter/recording.h"
#include "smartmill_stability/solvers/solver.h"
#include "stability/study_range.h"

namespace smartmill::stability {

/// Kinds of sound in a workshop.
enum class SoundKind {
  idle,            ///< spindle in air: its orders, a bearing, noise
  broadband,       ///< coolant and air, switched on and off
  other_machine,   ///< tones of another machine throughout, the spindle idles
  run_up,          ///< the spindle runs up, then idles
  stable,          ///< stable cut: strong tooth passing, chip noise through resonances
  stable_tone,     ///< the same with tones of another machine, without air in the recording
  speed_error,     ///< stable, with a wrong stated speed
  interrupted,     ///< stable, several short cuts
  chatter,         ///< 1.2 .. 2 times the limit
  chatter_no_air,  ///< the same without air in the recording
  chatter_shop,    ///< chatter with tones of another machine and a wrong stated speed
  chatter_interrupted,
  idle_bearing,  ///< a bearing louder than the spindle's orders, modulated by the revolution
  idle_hall,     ///< idle spindle, compressor, doors and music in a hall with echoes
  stable_hall,   ///< the same with a stable cut
  chatter_hall   ///< and with chatter
};
std::vector<SoundKind> soundKinds();
const char* nameOf(SoundKind kind);

/// How a scene is recorded.
enum class Capture {
  whole,     ///< at 44.1 kHz with a stated speed
  no_speed,  ///< without a stated speed
  brief,     ///< 3 .. 30 revolutions of the middle
  low_rate   ///< 2.2 .. 6 samples in a tooth passing period, without a filter: lines above are aliased
};
std::vector<Capture> captures();
const char* nameOf(Capture capture);

struct SoundScene {
  SoundKind kind{};
  Recording recording;
  double stated_speed = 0.0;  ///< [rad/s]
  double speed = 0.0;         ///< [rad/s]
  double depth = 0.0;         ///< [m]
  bool chatters = false;      ///< the simulated tip motion does not repeat
};

/// Scenes from a generator that is independent of the detector: the cut is simulated in the time domain
/// (smartmill_sim), its sound is the tip acceleration through resonances of machine and workshop; the rest is
/// synthesised. @param speeds range of the spindle and largest depth
std::vector<SoundScene> soundScenes(const MachineModel& model, const RegenerativeSystem& system,
                                    const StudyRange& range, const std::vector<SoundKind>& kinds);

/// The same of one cut at a speed [rad/s] and depth [m] that are given, with a second of the idle spindle
/// before and after it.
SoundScene cutScene(const MachineModel& model, const RegenerativeSystem& system, double speed, double depth,
                    unsigned seed);

/// Records a scene in another way. @param teeth of the tool
SoundScene captured(const SoundScene& scene, Capture capture, int teeth, unsigned seed);

}  // namespace smartmill::stability
