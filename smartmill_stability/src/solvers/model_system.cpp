#include "smartmill_stability/solvers/model_system.h"

#include <cstdio>
#include <string>

#include "smartmill_core/error.h"

namespace smartmill::stability {

double processDamping(const MachineModel& model) {
  constexpr const char* KEY = "coefficient_n_per_mm";
  double sum = 0.0;  // [N/mm]
  for (const EffectEntry& effect : model.effects)
    if (effect.name == "process_damping") sum += effect.numbers.at(KEY);
  if (sum < 0.0)
    throw Error(model.file + ": effects: process_damping: " + KEY + ": " + std::to_string(sum) +
                ": expected a value of at least 0 to predict stability");
  return sum * units::N_PER_MM;
}

RegenerativeSystem systemOf(const MachineModel& model, double entry_deg, double exit_deg) {
  const ToolGeometry& tool = model.needTool("predict stability");
  const CuttingCoefficients& cutting = model.needCutting("predict stability");
  RegenerativeSystem system;
  system.modes = systemModes(model.tool_tip.x, model.tool_tip.y);
  // The reaction moves the workpiece against the tool: receptances in series add.
  const WorkpieceModes workpiece = model.workpieceModes();
  for (const SystemMode& mode : systemModes(workpiece.x, workpiece.y)) system.modes.push_back(mode);
  if (system.modes.empty()) throw Error(model.file + ": tool_tip is missing (needed to predict stability)");
  system.teeth = tool.teeth;
  system.pitch = tool.pitch;
  system.helix = tool.helix;
  system.diameter = tool.diameter;
  system.edge = tool.edge;
  system.entry = units::radFromDeg(entry_deg);
  system.exit = units::radFromDeg(exit_deg);
  system.kt = cutting.ktc;
  system.kr = cutting.krc;
  system.ka = cutting.kac;
  system.setProcessDamping(processDamping(model));
  return system;
}

std::vector<double> rangeOf(const std::string& option, const std::string& text) {
  double low = 0.0, high = 0.0;
  int count = 0;
  char rest = 0;
  if (std::sscanf(text.c_str(), "%lf:%lf:%d%c", &low, &high, &count, &rest) != 3 || !(low > 0.0) ||
      !(high >= low) || count < 1 || (count > 1 && high == low)) {
    throw Error(option + " " + text + ": expected LO:HI:N with 0 < LO < HI and N >= 1");
  }
  std::vector<double> values;
  for (int i = 0; i < count; ++i) values.push_back(count == 1 ? low : low + (high - low) * i / (count - 1));
  return values;
}

}  // namespace smartmill::stability
