#include "stability/sound_sessions.h"

#include <gtest/gtest.h>

#include "smartmill_stability/solvers/model_system.h"

namespace smartmill::stability {
namespace {

// One of each kind of sound; the cuts are simulated in the time domain.
TEST(Recordings, soundsOfTheShopAreToldFromChatter) {
  const MachineModel model = readMachineModel(MODEL_FOLDER "/stiff.yaml");
  StudyRange range;
  range.speed_low = units::radPerSecFromRpm(6000.0);
  range.speed_high = units::radPerSecFromRpm(12000.0);
  range.max_depth = 20e-3;
  range.seed = 1;
  const auto scenes = soundScenes(model, systemOf(model, 90.0, 180.0), range, soundKinds());
  for (const SoundScene& scene : scenes) {
    RecordingRequest request;
    request.speed = scene.stated_speed;
    request.teeth = model.tool->teeth;
    const RecordingVerdict verdict = judgeRecording(scene.recording, request);
    EXPECT_EQ(verdict.chatter(), scene.chatters) << nameOf(scene.kind) << ": " << verdict.text();
    EXPECT_EQ(verdict.text().find('\n'), std::string::npos);
  }
}

// The same in the stream of a microphone: a cut is a try, and nothing else is.
TEST(SoundSessions, cutsAreFoundInTheStreamOfAMicrophone) {
  const MachineModel model = readMachineModel(MODEL_FOLDER "/stiff.yaml");
  StudyRange range;
  range.speed_low = units::radPerSecFromRpm(6000.0);
  range.speed_high = units::radPerSecFromRpm(12000.0);
  range.max_depth = 20e-3;
  range.seed = 2;
  using Kind = SoundKind;
  const auto scenes = soundScenes(model, systemOf(model, 90.0, 180.0), range,
                                  {Kind::idle, Kind::run_up, Kind::broadband, Kind::stable, Kind::chatter});
  for (const SoundScene& scene : scenes) {
    SoundParameters parameters;
    parameters.teeth = model.tool->teeth;
    parameters.speed = scene.stated_speed;
    SoundListener listener(parameters);
    std::uint64_t stream = 0;
    listenTo(scene, listener, stream);
    const auto& tries = listener.state().tries;
    const bool cut = scene.kind == Kind::stable || scene.kind == Kind::chatter;
    ASSERT_EQ(tries.size(), cut ? 1u : 0u) << nameOf(scene.kind) << ' ' << listener.state().text;
    if (!cut) continue;
    EXPECT_EQ(tries[0].kind,
              scene.chatters ? RecordingVerdict::Kind::chatter : RecordingVerdict::Kind::stable)
        << tries[0].text;
    EXPECT_NEAR(tries[0].begin, 1.0, 0.3);
    EXPECT_NEAR(tries[0].end, 3.5, 0.3);
  }
}

// From the first cut, which chatters, to a stable one at the same depth, by ear.
TEST(SoundSessions, aStableSpeedIsFoundByEar) {
  const MachineModel model = readMachineModel(MODEL_FOLDER "/stiff.yaml");
  const RegenerativeSystem system = systemOf(model, 90.0, 180.0);
  const SpeedRange range{units::radPerSecFromRpm(6000.0), units::radPerSecFromRpm(12000.0)};
  const FirstCut first = drawFirstCut(system, range, 20e-3, 3);
  const SoundSession session = runSoundSession(model, system, range, first.depth, first.speed, 3, 6);
  EXPECT_TRUE(session.cuts[0].scene.chatters);
  EXPECT_TRUE(session.stable) << session.cuts.size() << " cuts, " << session.cuts.back().heard.text;
}

}  // namespace
}  // namespace smartmill::stability
