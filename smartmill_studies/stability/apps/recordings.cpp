// rosrun smartmill_studies stability_recordings MODEL --entry-deg A --exit-deg B --speeds LO:HI
// --max-depth-mm D

#include <algorithm>
#include <array>
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
  bool modes = false, all_captures = false;
  StudyCase one;
};

struct Count {
  int all = 0, chatter = 0, unsure = 0, right = 0;
};
using Counts = std::map<std::string, Count>;  // by kind, by capture

/// One verdict. `unsure` is not right.
struct Outcome {
  std::string kind, capture, said;
  bool chatters = false;
  double probability = 0.0;  // [1]; NaN: no cut
  bool right() const { return said != "unsure" && (said == "chatter") == chatters; }
};

Outcome outcomeOf(const nlohmann::json& line) {
  const nlohmann::json& p = line.at("probability");
  return {line.at("kind"), line.at("capture"), line.at("said"), line.at("chatters"),
          p.is_null() ? NAN : p.get<double>()};
}

void print(const Counts& counts) {
  for (const auto& [name, count] : counts)
    std::printf("%-38s %6d %8d %7d %6d\n", name.c_str(), count.all, count.chatter, count.unsure, count.right);
}

/// Tables by kind and by capture, and the reliability of the probability.
void print(const std::vector<Outcome>& outcomes) {
  Counts kinds, ways;
  Count sum;
  constexpr int BINS = 5;
  std::array<double, BINS> predicted{}, chattering{}, size{};
  for (const Outcome& o : outcomes) {
    for (Count* count : {&kinds[o.kind], &ways[o.capture], &sum}) {
      ++count->all;
      count->chatter += o.said == "chatter";
      count->unsure += o.said == "unsure";
      count->right += o.right();
    }
    if (std::isnan(o.probability)) continue;
    const auto bin = static_cast<std::size_t>(std::min(BINS - 1.0, BINS * o.probability));
    predicted[bin] += o.probability;
    chattering[bin] += o.chatters;
    ++size[bin];
  }
  std::printf("%-38s %6s %8s %7s %6s\n", "kind", "scenes", "chatter", "unsure", "right");
  print(kinds);
  std::printf("%-38s\n", "recorded");
  print(ways);
  std::printf("right in %d of %d, unsure in %d\n", sum.right, sum.all, sum.unsure);
  std::printf("probability of chatter: stated, observed, recordings\n");
  for (std::size_t bin = 0; bin < BINS; ++bin)
    if (size[bin] > 0.0)
      std::printf("%6.3f %6.3f %5.0f\n", predicted[bin] / size[bin], chattering[bin] / size[bin], size[bin]);
}

/// Of eight recordings of a kind five are whole.
stability::Capture captureOf(int number) {
  constexpr int WHOLE = 5;
  const auto ways = stability::captures();
  return number % 8 < WHOLE ? stability::Capture::whole
                            : ways[static_cast<std::size_t>(number % 8 - WHOLE + 1)];
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

nlohmann::json lineOf(const Request& request, const MachineModel& model, const stability::SoundScene& whole,
                      int number, int of_kind) {
  const stability::Capture capture = request.all_captures ? captureOf(of_kind) : stability::Capture::whole;
  const stability::SoundScene scene = captured(whole, capture, model.tool->teeth,
                                               static_cast<unsigned>(seedOfCase(request.seed + 1, number)));
  const stability::RecordingVerdict verdict = judged(request, model, scene);
  return {{"case", number},
          {"kind", nameOf(scene.kind)},
          {"capture", nameOf(capture)},
          {"speed_rpm", units::rpmFromRadPerSec(scene.speed)},
          {"depth_mm", scene.depth / units::MM},
          {"chatters", scene.chatters},
          {"said", stability::nameOf(verdict.kind)},
          {"probability", verdict.probability},
          {"margin", verdict.margin},
          {"text", verdict.text()}};
}

/// One scene; the kinds alternate.
void runOne(const Request& request, const MachineModel& model, int cases) {
  request.one.check(cases);
  const auto kinds = stability::soundKinds();
  stability::StudyRange range = request.range();
  range.seed = static_cast<unsigned>(seedOfCase(range.seed, request.one.number));
  const auto number = static_cast<std::size_t>(request.one.number);
  const auto scene = soundScenes(model, request.system(model), range, {kinds[number % kinds.size()]}).front();
  request.one.print(
      lineOf(request, model, scene, request.one.number, static_cast<int>(number / kinds.size())));
}

void run(const Request& request) {
  std::vector<Outcome> outcomes;
  if (request.one.scores()) {
    for (const nlohmann::json& line : readJsonLines(request.one.lines)) outcomes.push_back(outcomeOf(line));
    return print(outcomes);
  }
  const MachineModel model = request.machine();
  std::vector<stability::SoundKind> kinds;
  for (const stability::SoundKind kind : stability::soundKinds())
    kinds.insert(kinds.end(), static_cast<std::size_t>(request.each), kind);
  const int cases = request.cases > 0 ? request.cases : static_cast<int>(kinds.size());
  if (request.one.one()) return runOne(request, model, cases);
  if (request.cases > 0) throw UsageError("--cases: requires --case; --each is the number of each kind");
  const auto scenes = soundScenes(model, request.system(model), request.range(), kinds);
  for (std::size_t k = 0; k < scenes.size(); ++k) {
    const stability::SoundScene& scene = scenes[k];
    const int number = static_cast<int>(k);
    const nlohmann::json line = lineOf(request, model, scene, number, number % request.each);
    outcomes.push_back(outcomeOf(line));
    if (!outcomes.back().right())
      std::printf("scene %zu, %s, %s, %s, %.0f rpm, %.2f mm: %s\n", k, nameOf(scene.kind),
                  outcomes.back().capture.c_str(), scene.chatters ? "chatters" : "does not",
                  units::rpmFromRadPerSec(scene.speed), scene.depth / units::MM,
                  line.at("text").get<std::string>().c_str());
    if (request.out.empty()) continue;
    SoundFile sound{scene.recording.sample_rate, scene.recording.channels};
    for (double& v : sound.channels[0]) v *= 0.2;
    writeWav(sound, request.out + formatted("/scene_%03zu.wav", k));
    std::ofstream(request.out + "/scenes.jsonl", std::ios::app) << line.dump() << "\n";
  }
  print(outcomes);
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line{"Chatter verdicts on synthesised sound recordings of many kinds."};
  request.addTo(line);
  line.option("--each", request.each, "scenes of each kind (10)").within(1, 1000000);
  line.option("--cases", request.cases, "number of scenes, with alternating kinds, for --case (16 x EACH)")
      .within(1, 1000000);
  line.option("--case", request.one.number, "only this case (0..): prints its line of JSON");
  request.one.addScore(line);
  line.flag("--modes", request.modes, "pass the modes of the machine to the verdict");
  line.flag(
      "--captures", request.all_captures,
      "of eight recordings of a kind one without a stated speed, one of few revolutions, one at a low rate");
  line.option("-o,--out", request.out, "existing folder for the scenes as WAV files");
  return runProgram(line, argc, argv, [&] { run(request); });
}
