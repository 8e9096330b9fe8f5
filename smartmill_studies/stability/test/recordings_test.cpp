#include "stability/sound_scenes.h"

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

}  // namespace
}  // namespace smartmill::stability
