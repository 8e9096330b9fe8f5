#include "smartmill_program/prediction/tool_models.h"

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/model/tool_files.h"
#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

MachineModel withTool(const std::string& file) {
  MachineModel model = readMachineModel(file);
  if (model.needTool("simulate a program").teeth == 0)
    throw Error(file + ": tool.teeth: 0, expected an end mill");
  for (const EffectEntry& effect : model.effects)
    if (effect.name == "corner_radius")
      model.tool->edge.corner_radius = effect.numbers.at("corner_radius_mm") * units::MM;
  try {
    validate(*model.tool);
  } catch (const Error& error) {
    throw Error(file + ": " + error.what());
  }
  return model;
}

}  // namespace

ToolModels::ToolModels(const std::vector<std::string>& files) {
  for (const std::string& text : files) {
    if (const ToolFile tool = toolFileOf(text); tool.number) {
      if (!models_.emplace(*tool.number, withTool(tool.file)).second)
        throw Error("--model " + text + ": tool " + std::to_string(*tool.number) + " a second time");
    } else if (only_) {
      throw Error("--model " + text + ": expected N=FILE, the number of the tool for each of several models");
    } else {
      only_ = withTool(text);
    }
  }
}

const MachineAxes* ToolModels::axes() const {
  if (only_ && only_->axes) return &*only_->axes;
  for (const auto& [number, model] : models_)
    if (model.axes) return &*model.axes;
  return nullptr;
}

double ToolModels::rapid() const {
  return axes() ? axes()->rapid : 0.0;
}

double ToolModels::acceleration() const {
  return axes() ? axes()->acceleration : 0.0;
}

const MachineModel& ToolModels::of(int tool) {
  const auto found = models_.find(tool);
  if (found != models_.end()) return found->second;
  const std::string name = tool == 0 ? "no tool selected (T and M6)" : "T" + std::to_string(tool);
  if (!only_)
    throw Error(name + ": no model of this tool, expected --model " + std::to_string(tool) + "=FILE");
  const MachineModel model = *only_;
  only_.reset();
  return models_.emplace(tool, model).first->second;
}

const ToolShape& ToolModels::shape(int tool) {
  const auto known = shapes_.find(tool);
  if (known != shapes_.end()) return known->second;
  const MachineModel& model = of(tool);
  // An inclined edge of unknown height reaches above any stock.
  constexpr double UNLIMITED = 1.0;  // [m]
  ToolShape shape(ToolProfile(*model.tool, model.edge_height.value_or(UNLIMITED)));
  if (model.holder_diameter && model.stickout) {
    shape.holder_radius = 0.5 * *model.holder_diameter;
    shape.holder_height = *model.stickout;
  }
  return shapes_.emplace(tool, shape).first->second;
}

}  // namespace smartmill::program
