// rosrun smartmill_studies stability_sound_sessions MODEL --entry-deg A --exit-deg B --speeds LO:HI
// --max-depth-mm D

#include <cstdio>
#include <map>
#include <string>

#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "stability/sound_sessions.h"
#include "stability/study_request.h"
#include "study_case.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::stability;  // NOLINT

struct Request : StudyRequest {
  int sessions = 30, each = 0;
};

constexpr int MOST = 10;  // tries

/// Tries of each kind of sound that a stream of scenes gives.
void streamScenes(const Request& request, const MachineModel& model) {
  std::printf("%-38s %6s %6s %8s %6s %6s\n", "one scene after the other", "scenes", "stable", "chatter",
              "unsure", "none");
  for (const SoundKind kind : soundKinds()) {
    const auto scenes = soundScenes(model, request.system(model), request.range(),
                                    std::vector<SoundKind>(static_cast<std::size_t>(request.each), kind));
    std::map<RecordingVerdict::Kind, int> count;
    for (const SoundScene& scene : scenes) {
      SoundParameters parameters;
      parameters.teeth = model.tool->teeth;
      parameters.speed = scene.stated_speed;
      SoundListener listener(parameters);
      std::uint64_t stream = 0;
      listenTo(scene, listener, stream);
      listener.stop("the scene ends");
      while (const auto job = listener.nextJob()) listener.finish(job->run());
      for (const SoundTry& heard : listener.state().tries) ++count[heard.kind];
      count[RecordingVerdict::Kind::no_cut] += listener.state().tries.empty();
    }
    using Kind = RecordingVerdict::Kind;
    std::printf("%-38s %6zu %6d %8d %6d %6d\n", nameOf(kind), scenes.size(), count[Kind::stable],
                count[Kind::chatter], count[Kind::unsure], count[Kind::no_cut]);
  }
}

void run(const Request& request) {
  const MachineModel model = request.machine();
  if (request.each > 0) streamScenes(request, model);
  const RegenerativeSystem system = request.system(model);
  const StudyRange range = request.range();
  const SpeedRange speeds{range.speed_low, range.speed_high};
  int stable = 0, tries = 0, most = 0, cuts = 0, wrong = 0, undecided = 0;
  for (int k = 0; k < request.sessions; ++k) {
    const auto seed = static_cast<unsigned>(seedOfCase(range.seed, k));
    const FirstCut first = drawFirstCut(system, speeds, range.max_depth, seed);
    const SoundSession session = runSoundSession(model, system, speeds, first.depth, first.speed, seed, MOST);
    const int count = static_cast<int>(session.cuts.size()) - 1;
    stable += session.stable;
    tries += count;
    most = std::max(most, count);
    std::printf("session %d, %.2f mm:", k, first.depth / units::MM);
    for (const SoundSession::Cut& cut : session.cuts) {
      const bool decides = cut.heard.decides();
      wrong += decides && (cut.heard.kind == RecordingVerdict::Kind::chatter) != cut.scene.chatters;
      undecided += !decides;
      ++cuts;
      if (!decides) std::printf(" (%s)", cut.heard.text.c_str());
      std::printf(" %.0f rpm %s, heard %s;", units::rpmFromRadPerSec(cut.scene.speed),
                  cut.scene.chatters ? "chatters" : "stable", nameOf(cut.heard.kind));
    }
    std::printf("\n");
  }
  std::printf(
      "stable after the first cut in %d of %d sessions, tries mean %.2f, largest %d; of %d cuts %d heard "
      "wrongly, %d "
      "not decided\n",
      stable, request.sessions, static_cast<double>(tries) / request.sessions, most, cuts, wrong, undecided);
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line{
      "Cuts at the speeds that sound_node's library proposes, from the sound of simulated cuts until one is "
      "stable."};
  request.addTo(line);
  line.option("--sessions", request.sessions, "sessions (30)").within(1, 1000000);
  line.option("--each", request.each, "before them scenes of each kind of sound in a stream (0)")
      .within(0, 1000000);
  return runProgram(line, argc, argv, [&] { run(request); });
}
