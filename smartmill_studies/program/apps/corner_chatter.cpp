// rosrun smartmill_studies program_corner_chatter: which block of a pocket chatters, by prediction and by the
// chatter detection on the simulated machine, of pockets whose corner alone is unstable.

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "program/corner_pocket.h"
#include "program/machined_part.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_program/nc/program_reader.h"
#include "smartmill_program/program_analysis.h"
#include "smartmill_stability/chatter/chatter_detector.h"
#include "study_case.h"

namespace {

using namespace smartmill;

constexpr double HOLD_BACK = 0.05;  // [s]
constexpr double COLUMN = 1e-4;     // [m] of the stock

struct Arguments {
  StudyCase study;
  std::string model = "launch/models/mill_twin.yaml", folder = "corner_chatter";
  int cases = 50;
  std::uint64_t seed = 13;
};

/// The line whose stability margin is least, and that margin.
struct Predicted {
  int line = 0;
  double margin = 1e9;
};

Predicted predict(const std::string& text, const std::string& model_file, const MachineModel& machine) {
  program::ToolModels models({model_file});
  program::Stock stock(program::StockBlock{machine.workpiece->low, machine.workpiece->high}, COLUMN);
  program::ProgramAnalysis analysis("corner", models, stock);
  Predicted predicted;
  for (const program::BlockSummary& block : analysis.run(program::interpretProgram(text, "corner")).blocks)
    if (block.margin < predicted.margin) predicted = {block.line, block.margin};
  return predicted;
}

/// Verdicts of the chatter detection, by condition.
struct Verdicts {
  int windows = 0, chatter = 0;
  double severity = 0.0;  // [N] largest
};

nlohmann::json lineOf(const Arguments& a, int number) {
  const std::uint64_t seed = seedOfCase(a.seed, number);
  std::mt19937_64 random(seed);
  const CornerCase drawn = drawCornerCase(readMachineModel(a.model), random);
  std::filesystem::create_directories(a.folder);
  const std::string file = formatted("%s/machine_%d.yaml", a.folder.c_str(), number),
                    text = cornerProgram(drawn.pocket, drawn.machine);
  writeMachineModel(drawn.machine, file);
  const Predicted predicted = predict(text, file, drawn.machine);

  std::map<std::string, Verdicts> verdicts;
  std::set<std::string> unsteady;  // conditions, which are not of one block: program_unsteady_chatter
  std::string first;               // that chatters
  stability::DetectionPipeline detection(stability::ChatterParameters(), HOLD_BACK,
                                         [&](const stability::ChatterState& state) {
                                           if (!state.valid || unsteady.count(state.condition) > 0) return;
                                           Verdicts& of = verdicts[state.condition];
                                           ++of.windows;
                                           of.chatter += state.chatter;
                                           if (state.chatter)
                                             of.severity = std::max(of.severity, state.severity);
                                           if (state.chatter && first.empty()) first = state.condition;
                                         });
  PartStreams streams;
  streams.state = [&](const CncState& state) { detection.push(state); };
  streams.condition = [&](const CuttingCondition& condition) {
    if (condition.kind == CuttingCondition::Kind::unsteady) unsteady.insert(condition.name);
    detection.push(condition);
  };
  streams.sensors = [&](const sim::World::Block& block) {
    for (const SpindleAngle& angle : block.angle) detection.push(angle);
    detection.push(block.dynamometer);
  };
  PartSetUp set_up;
  set_up.from_memory = true;
  set_up.magazine = {{1, drawn.machine}};
  const MachinedPart part = machinePart(drawn.machine, drawn.machine, text,
                                        preparedPart(text, {file}, drawn.machine), seed, streams, set_up);
  detection.flush();
  // The measured block is the one with the strongest chatter.
  int measured = 0, chattering = 0, judged = 0;
  double share = 0.0;
  for (const auto& [name, of] : verdicts) {
    ++judged;
    if (of.chatter == 0) continue;
    ++chattering;
    const double own = of.severity;
    if (own <= share) continue;
    share = own;
    measured = std::atoi(name.substr(name.rfind("line ") + 5).c_str());
  }
  return {{"case", number},
          {"teeth", drawn.machine.tool->teeth},
          {"depth", drawn.pocket.depth},
          {"levels", drawn.pocket.levels},
          {"corner_margin", drawn.pocket.corner_margin},
          {"line_margin", drawn.pocket.line_margin},
          {"predicted", predicted.line},
          {"margin", predicted.margin},
          {"measured", measured},
          {"judged", judged},
          {"chattering", chattering},
          {"first", first},
          {"severity", share},
          {"cuts", part.cuts},
          {"lost", part.lost},
          {"time", part.time}};
}

void score(const std::vector<nlohmann::json>& lines) {
  int same = 0, alone = 0, none = 0, other = 0, lost = 0;
  for (const nlohmann::json& line : lines) {
    const int measured = line["measured"].get<int>();
    const bool agrees = measured == line["predicted"].get<int>();
    same += agrees;
    alone += agrees && line["chattering"].get<int>() == 1;
    none += measured == 0;
    other += measured != 0 && !agrees;
    lost += line["lost"].get<int>();
  }
  std::printf(
      "%d of %zu: the predicted block is the measured one (aim 45 of 50); in %d of them no other chatters\n",
      same, lines.size(), alone);
  std::printf("%d without chatter, %d in another block; %d losses of the path\n", none, other, lost);
}

}  // namespace

int main(int argc, char** argv) {
  CommandLine line(
      "Chatter in the corner of a pocket: the block with the least stability margin by the analysis of the "
      "program, "
      "and the block that the chatter detection names while the simulated machine mills it.");
  Arguments a;
  a.study.addTo(line, "--cases", a.cases, "number of machines, each with one pocket");
  a.study.addScore(line);
  line.option("--model", a.model, "machine model").showDefault();
  line.option("--folder", a.folder, "folder for the models of the machines").showDefault();
  line.option("--seed", a.seed, "of machines, pockets and noise").showDefault();
  return runProgram(line, argc, argv, [&] {
    a.study.run(
        a.cases, [&](int number) { return lineOf(a, number); }, score);
  });
}
