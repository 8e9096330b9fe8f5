#include "smartmill_sim/commands.h"

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/model/effect_catalogue.h"

namespace {

using namespace smartmill;

// Whether some seconds of cutting with a stiff tool show it in the force signals.
bool isShort(const EffectKind& kind) {
  // Drift and tilt develop slowly within a record or a cut; a limit may never be reached.
  static const std::vector<std::string> SLOW{"charge_drift", "depth_tilt", "saturation"};
  return std::find(SLOW.begin(), SLOW.end(), kind.name) == SLOW.end() && kind.stage != EffectStage::drive &&
         kind.stage != EffectStage::structure && !kind.has(EffectNeed::start_time) &&
         !kind.has(EffectNeed::cut_time) && !kind.has(EffectNeed::flexible_tool) &&
         !kind.has(EffectNeed::axis_motion);
}

EffectEntry drawn(const MachineModel& model, std::mt19937_64& random) {
  std::vector<std::string> names;
  for (const EffectKind& kind : effectCatalogue()) {
    if (isShort(kind)) names.push_back(kind.name);
  }
  for (;;) {
    const std::string& name = names[std::uniform_int_distribution<std::size_t>(0, names.size() - 1)(random)];
    EffectEntry entry = drawEffect(name, model, random);
    const auto channel = entry.words.find("channel");
    if (channel == entry.words.end() || channel->second.front() == 'f') return entry;
  }
}

struct Arguments {
  std::string model, out, effect;
  std::uint64_t seed = 1;
};

void run(const Arguments& a) {
  MachineModel model = readMachineModel(a.model);
  model.needTool("hide an effect");
  std::mt19937_64 random(a.seed);
  // A real machine deviates from its model.
  model.needCutting("hide an effect");
  for (const CuttingKey& key : cuttingKeys()) {
    double& value = (*model.cutting).*key.coefficient;
    value *= 1.0 + 0.01 * model.uncertainty.cutting * std::normal_distribution<double>()(random);
  }
  model.effects.push_back(a.effect.empty() ? drawn(model, random) : drawEffect(a.effect, model, random));
  writeMachineModel(model, a.out);
}

}  // namespace

namespace smartmill::sim {

Command hideCommand() {
  Command command("hide", "draws a machine with an effect that its model lacks");
  command.description =
      "Draws a machine that differs from its model: cutting coefficients within their stated uncertainty, "
      "and "
      "one effect.";
  command.examples = {{"mill.yaml -o hidden.yaml --seed 7", "draws the effect as well"},
                      {"mill.yaml -o hidden.yaml --effect runout", "draws the size of a given effect"}};
  command.files = {{"OUT", "model file of the machine, with the effect in its section effects"}};
  command.setBody(run, [](CommandLine& line, Arguments& a) {
    line.option("MODEL", a.model, "model file of the machine as assumed").required();
    line.option("-o,--out", a.out, "model file of the actual machine").required();
    line.option("--effect", a.effect, "name of the effect (default: drawn)");
    line.option("--seed", a.seed, "seed of the draw").showDefault();
  });
  return command;
}

}  // namespace smartmill::sim
