#include "smartmill_program/tool/sharp_tools.h"

#include <cmath>

#include "smartmill_core/cutting/same_tool.h"
#include "smartmill_core/error.h"
#include "smartmill_program/live/condition_names.h"

namespace smartmill::program {
namespace {

/// Whether the mean tangential force follows from them.
bool giveTangentialForce(const CuttingCoefficients& k) {
  return std::isfinite(k.ktc + k.kte);
}

}  // namespace

SharpTools::SharpTools(std::map<int, MachineModel> models) : models_(std::move(models)) {
  if (models_.empty()) throw Error("model: empty: expected the path of a smartmill-model/1 file");
  for (const auto& [number, model] : models_) model.needTool("distinguish its teeth");
}

void SharpTools::add(const CoefficientSet& set) {
  if (giveTangentialForce(set.value))
    identified_.try_emplace({set.tool, set.material},
                            SharpCoefficients{set.value, set.std_dev, set.tool + " in " + set.material});
}

const MachineModel* SharpTools::modelOf(const CuttingCondition& condition) const {
  const auto of_number = models_.find(toolNumberOf(condition.tool_name));
  const auto model = of_number != models_.end() ? of_number : models_.find(0);
  return model != models_.end() && isSameTool(*model->second.tool, condition.tool) ? &model->second : nullptr;
}

std::optional<SharpCoefficients> SharpTools::of(const CuttingCondition& condition) const {
  const MachineModel* model = modelOf(condition);
  if (model && model->cutting && giveTangentialForce(*model->cutting))
    return SharpCoefficients{*model->cutting, model->cutting_std.value_or(NOT_IDENTIFIED), model->file};
  const auto found = identified_.find({condition.tool_name, condition.material});
  return found == identified_.end() ? std::nullopt : std::optional<SharpCoefficients>(found->second);
}

}  // namespace smartmill::program
