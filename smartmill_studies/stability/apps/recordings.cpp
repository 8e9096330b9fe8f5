// rosrun smartmill_studies stability_recordings MODEL --entry-deg A --exit-deg B --speeds LO:HI
// --max-depth-mm D

#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "smartmill_core/formatted.h"
#include "smartmill_core/io/sound_file.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "stability/sound_scenes.h"
#include "stability/study_request.h"

namespace {

using namespace smartmill;

struct Request : stability::StudyRequest {
  int each = 10;
  bool modes = false;
};

void run(const Request& request) {
  const MachineModel model = request.machine();
  std::vector<stability::SoundKind> kinds;
  for (const stability::SoundKind kind : stability::soundKinds())
    kinds.insert(kinds.end(), request.each, kind);
  const auto scenes = soundScenes(model, request.system(model), request.range(), kinds);
  struct Count {
    int all = 0, said = 0, right = 0, near = 0;
  };
  std::map<stability::SoundKind, Count> counts;
  std::string list;  // file, told and true speed [rpm], truth, kind
  for (std::size_t k = 0; k < scenes.size(); ++k) {
    const stability::SoundScene& scene = scenes[k];
    stability::RecordingRequest asked;
    asked.speed = scene.told_speed;
    asked.teeth = model.tool->teeth;
    if (request.modes)
      for (const ModalModel* axis : {&model.tool_tip.x, &model.tool_tip.y})
        for (const Mode& mode : axis->modes) asked.modes.push_back(mode.frequency);
    const stability::RecordingVerdict verdict = judgeRecording(scene.recording, asked);
    Count& count = counts[scene.kind];
    ++count.all;
    count.said += verdict.chatter;
    count.right += verdict.chatter == scene.chatters;
    if (verdict.chatter != scene.chatters)
      std::printf("scene %zu, %s, %s, %.0f rpm (told %.0f), %.2f mm: %s\n", k, nameOf(scene.kind),
                  scene.chatters ? "chatters" : "does not", units::rpmFromRadPerSec(scene.speed),
                  units::rpmFromRadPerSec(scene.told_speed), scene.depth / units::MM, verdict.text().c_str());
    if (request.out.empty()) continue;
    SoundFile sound{scene.recording.sample_rate, scene.recording.channels};
    for (double& v : sound.channels[0]) v *= 0.2;
    const std::string file = request.out + formatted("/scene_%03zu.wav", k);
    writeWav(sound, file);
    list +=
        formatted("%s %.2f %.2f %d %s\n", file.c_str(), units::rpmFromRadPerSec(scene.told_speed),
                  units::rpmFromRadPerSec(scene.speed), static_cast<int>(scene.chatters), nameOf(scene.kind));
  }
  if (!request.out.empty()) std::ofstream(request.out + "/scenes.txt") << list;
  int right = 0;
  std::printf("%-38s %6s %12s %6s\n", "kind", "scenes", "said chatter", "right");
  for (const auto& [kind, count] : counts) {
    std::printf("%-38s %6d %12d %6d\n", nameOf(kind), count.all, count.said, count.right);
    right += count.right;
  }
  std::printf("right in %d of %zu\n", right, scenes.size());
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line{"Recorded sound of many kinds, synthesised, through the judge of recordings."};
  request.addTo(line);
  line.option("--each", request.each, "scenes of each kind (10)");
  line.flag("--modes", request.modes, "the judge knows the machine's modes");
  line.option("-o,--out", request.out, "folder that is there, for the scenes as WAV files");
  return runProgram(line, argc, argv, [&] { run(request); });
}
