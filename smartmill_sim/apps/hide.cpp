// rosrun smartmill_sim hide MODEL -o FILE --seed N: a machine that has an effect its model does not tell of.

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/program.h"

namespace {

using namespace smartmill;

// Whether the force sensor sees it in some seconds of cutting with a stiff tool.
bool isShort(const EffectKind& kind) {
  // Drift and tilt count from a record's begin or a cut's; a limit may never be reached.
  static const std::vector<std::string> SLOW{"charge_drift", "depth_tilt", "saturation"};
  return std::find(SLOW.begin(), SLOW.end(), kind.name) == SLOW.end() && kind.stage != EffectStage::drive &&
         kind.stage != EffectStage::structure && !kind.has(EffectNeed::start_time) &&
         !kind.has(EffectNeed::cut_time) && !kind.has(EffectNeed::flexible_tool);
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

void run(const std::string& file, const std::string& out, const std::string& effect, std::uint64_t seed) {
  MachineModel model = readMachineModel(file);
  model.needTool("hide an effect");
  std::mt19937_64 random(seed);
  // No machine is just what is believed of it.
  model.needCutting("hide an effect");
  for (const CuttingKey& key : cuttingKeys()) {
    double& value = (*model.cutting).*key.coefficient;
    value *= 1.0 + 0.01 * model.uncertainty.cutting * std::normal_distribution<double>()(random);
  }
  model.effects.push_back(effect.empty() ? drawn(model, random) : drawEffect(effect, model, random));
  writeMachineModel(model, out);
}

}  // namespace

int main(int argc, char** argv) {
  std::string model, out, effect;
  std::uint64_t seed = 1;
  smartmill::CommandLine line{
      "Draws what a machine hides: cutting values within their stated uncertainty, and one effect."};
  line.option("model", model, "what is believed of the machine").required();
  line.option("-o,--out", out, "model file of the machine").required();
  line.option("--effect", effect, "its name; default: drawn as well");
  line.option("--seed", seed, "of the draw");
  return smartmill::runProgram(line, argc, argv, [&] { run(model, out, effect, seed); });
}
