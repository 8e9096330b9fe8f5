#include "stability/sound_sessions.h"

#include <cmath>
#include <random>

#include "smartmill_core/error.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

void listenTo(const SoundScene& scene, SoundListener& listener, std::uint64_t& stream) {
  constexpr std::size_t BLOCK = 441;
  const Recording& sound = scene.recording;
  for (std::size_t from = 0; from < sound.channels[0].size(); from += BLOCK) {
    const std::size_t to = std::min(from + BLOCK, sound.channels[0].size());
    SampleBlock block;
    block.stamp = static_cast<double>(stream) / sound.sample_rate;
    block.sample_rate = sound.sample_rate;
    block.first_index = stream;
    block.channels = {"sound"};
    block.units = {"1"};
    block.samples.assign(sound.channels[0].begin() + static_cast<std::ptrdiff_t>(from),
                         sound.channels[0].begin() + static_cast<std::ptrdiff_t>(to));
    listener.push(block);
    stream += to - from;
    while (const auto job = listener.nextJob()) listener.finish(job->run());
  }
}

SoundSession runSoundSession(const MachineModel& model, const RegenerativeSystem& system,
                             const SpeedRange& range, double depth, double first, unsigned seed, int most) {
  SoundParameters parameters;
  parameters.teeth = system.teeth;
  parameters.speed_low = range.low;
  parameters.speed_high = range.high;
  SoundListener listener(parameters);
  std::uint64_t stream = 0;
  SoundSession session;
  double speed = first;
  for (int k = 0; k <= most; ++k) {
    CutSetting setting;
    setting.speed = speed;
    listener.set(setting);
    SoundSession::Cut cut;
    cut.scene = cutScene(model, system, speed, depth, seed + static_cast<unsigned>(k));
    const std::size_t before = listener.state().tries.size();
    listenTo(cut.scene, listener, stream);
    cut.scene.recording = {};
    cut.heard.kind = RecordingVerdict::Kind::no_cut;
    cut.heard.text = listener.state().text;
    if (listener.state().tries.size() > before) cut.heard = listener.state().tries.back();
    session.cuts.push_back(cut);
    session.stable = !cut.scene.chatters && cut.heard.kind == RecordingVerdict::Kind::stable;
    if (cut.heard.kind == RecordingVerdict::Kind::stable || listener.state().advice.speeds.empty()) break;
    speed = listener.state().advice.speeds[0].speed;
  }
  return session;
}

FirstCut drawFirstCut(const RegenerativeSystem& system, const SpeedRange& range, double max_depth,
                      unsigned seed) {
  constexpr int SPEEDS = 60, TRIES = 1000;
  constexpr double LEAST_STABLE = 0.2, CHATTERS = 1.05,
                   STABLE = 0.97;  // [1] of speeds, radius of the multiplier
  const auto solver = makeFloquetSolver(Method::collocation, system);
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit;
  for (int k = 0; k < TRIES; ++k) {
    FirstCut cut;
    cut.speed = range.low + (range.high - range.low) * unit(random);
    const double limit = solver->limit(cut.speed, max_depth).depth;
    if (!std::isfinite(limit)) continue;
    cut.depth = limit * (1.3 + 0.7 * unit(random));
    if (solver->multiplier(cut.speed, cut.depth).radius() < CHATTERS) continue;
    int stable = 0;
    for (int s = 0; s < SPEEDS; ++s) {
      const double speed = range.low + (range.high - range.low) * s / (SPEEDS - 1.0);
      stable += solver->multiplier(speed, cut.depth).radius() < STABLE;
    }
    if (stable >= LEAST_STABLE * SPEEDS) return cut;
  }
  throw Error("sound sessions: no cut that chatters next to stable speeds was found");
}

}  // namespace smartmill::stability
