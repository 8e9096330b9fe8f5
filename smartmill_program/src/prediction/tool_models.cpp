#include "smartmill_program/prediction/tool_models.h"

#include <algorithm>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
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

/// Number before '=' if there is one; nullopt: a file only.
std::optional<int> numberOf(const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0 || equals > 4) return std::nullopt;
  const std::string number = text.substr(0, equals);
  if (!std::all_of(number.begin(), number.end(), [](char c) { return c >= '0' && c <= '9'; }))
    return std::nullopt;
  return std::stoi(number);
}

}  // namespace

ToolModels::ToolModels(const std::vector<std::string>& files) {
  for (const std::string& text : files) {
    if (const std::optional<int> number = numberOf(text)) {
      if (!models_.emplace(*number, withTool(text.substr(text.find('=') + 1))).second)
        throw Error("--model " + text + ": tool " + std::to_string(*number) + " a second time");
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

}  // namespace smartmill::program
