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
#include "study_case.h"

namespace {

using namespace smartmill;

struct Request : stability::StudyRequest {
  int each = 10, cases = 0;
  bool modes = false;
  StudyCase one;
};

struct Count {
  int all = 0, verdicts = 0, right = 0;
  void add(bool chatter, bool truth) {
    ++all;
    verdicts += chatter;
    right += chatter == truth;
  }
};
using Counts = std::map<std::string, Count>;  // by kind

void print(const Counts& counts) {
  int right = 0, all = 0;
  std::printf("%-38s %6s %12s %6s\n", "kind", "scenes", "chatter", "right");
  for (const stability::SoundKind kind : stability::soundKinds()) {
    const auto found = counts.find(nameOf(kind));
    if (found == counts.end()) continue;
    const Count& count = found->second;
    std::printf("%-38s %6d %12d %6d\n", nameOf(kind), count.all, count.verdicts, count.right);
    right += count.right;
    all += count.all;
  }
  std::printf("right in %d of %d\n", right, all);
}

stability::RecordingVerdict judged(const Request& request, const MachineModel& model,
                                   const stability::SoundScene& scene) {
  stability::RecordingRequest recording_request;
  recording_request.speed = scene.stated_speed;
  recording_request.teeth = model.tool->teeth;
  if (request.modes)
    for (const ModalModel* axis : {&model.tool_tip.x, &model.tool_tip.y})
      for (const Mode& mode : axis->modes) recording_request.modes.push_back(mode.frequency);
  return judgeRecording(scene.recording, recording_request);
}

/// One scene; the kinds alternate.
void runOne(const Request& request, const MachineModel& model, int cases) {
  request.one.check(cases);
  const auto kinds = stability::soundKinds();
  stability::StudyRange range = request.range();
  range.seed = static_cast<unsigned>(seedOfCase(range.seed, request.one.number));
  const auto scene = soundScenes(model, request.system(model), range,
                                 {kinds[static_cast<std::size_t>(request.one.number) % kinds.size()]})
                         .front();
  const stability::RecordingVerdict verdict = judged(request, model, scene);
  request.one.print({{"case", request.one.number},
                     {"kind", nameOf(scene.kind)},
                     {"speed_rpm", units::rpmFromRadPerSec(scene.speed)},
                     {"depth_mm", scene.depth / units::MM},
                     {"chatters", scene.chatters},
                     {"said", verdict.chatter},
                     {"right", verdict.chatter == scene.chatters}});
}

void run(const Request& request) {
  if (request.one.scores()) {
    Counts counts;
    for (const nlohmann::json& line : readJsonLines(request.one.lines))
      counts[line.at("kind")].add(line.at("said"), line.at("chatters"));
    return print(counts);
  }
  const MachineModel model = request.machine();
  std::vector<stability::SoundKind> kinds;
  for (const stability::SoundKind kind : stability::soundKinds())
    kinds.insert(kinds.end(), static_cast<std::size_t>(request.each), kind);
  const int cases = request.cases > 0 ? request.cases : static_cast<int>(kinds.size());
  if (request.one.one()) return runOne(request, model, cases);
  if (request.cases > 0) throw UsageError("--cases: requires --case; --each is the number of each kind");
  const auto scenes = soundScenes(model, request.system(model), request.range(), kinds);
  Counts counts;
  std::string list;  // file, stated and true speed [rpm], truth, kind
  for (std::size_t k = 0; k < scenes.size(); ++k) {
    const stability::SoundScene& scene = scenes[k];
    const stability::RecordingVerdict verdict = judged(request, model, scene);
    counts[nameOf(scene.kind)].add(verdict.chatter, scene.chatters);
    if (verdict.chatter != scene.chatters)
      std::printf("scene %zu, %s, %s, %.0f rpm (stated %.0f), %.2f mm: %s\n", k, nameOf(scene.kind),
                  scene.chatters ? "chatters" : "does not", units::rpmFromRadPerSec(scene.speed),
                  units::rpmFromRadPerSec(scene.stated_speed), scene.depth / units::MM,
                  verdict.text().c_str());
    if (request.out.empty()) continue;
    SoundFile sound{scene.recording.sample_rate, scene.recording.channels};
    for (double& v : sound.channels[0]) v *= 0.2;
    const std::string file = request.out + formatted("/scene_%03zu.wav", k);
    writeWav(sound, file);
    list +=
        formatted("%s %.2f %.2f %d %s\n", file.c_str(), units::rpmFromRadPerSec(scene.stated_speed),
                  units::rpmFromRadPerSec(scene.speed), static_cast<int>(scene.chatters), nameOf(scene.kind));
  }
  if (!request.out.empty()) std::ofstream(request.out + "/scenes.txt") << list;
  print(counts);
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line{"Chatter verdicts on synthesised sound recordings of many kinds."};
  request.addTo(line);
  line.option("--each", request.each, "scenes of each kind (10)").within(1, 1000000);
  line.option("--cases", request.cases, "number of scenes, with alternating kinds, for --case (12 x EACH)")
      .within(1, 1000000);
  line.option("--case", request.one.number, "only this case (0..): prints its line of JSON");
  request.one.addScore(line);
  line.flag("--modes", request.modes, "pass the modes of the machine to the verdict");
  line.option("-o,--out", request.out, "existing folder for the scenes as WAV files");
  return runProgram(line, argc, argv, [&] { run(request); });
}
