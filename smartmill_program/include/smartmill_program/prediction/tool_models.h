#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_program/stock/tool_shape.h"

namespace smartmill::program {

/// Machine models by the tool numbers (T) of a program. A model file describes one tool.
class ToolModels {
 public:
  /// @param files "MODEL" for the only tool of a program, or "N=MODEL" for tool number N
  /// @throws Error on a repeated number, and as readMachineModel and MachineModel::needTool
  explicit ToolModels(const std::vector<std::string>& files);

  /// @throws Error "T3: expected --model 3=FILE, ..." for a tool without model
  const MachineModel& of(int tool);
  double radius(int tool) { return of(tool).tool->radius(); }  ///< [m]
  const ToolShape& shape(int tool);
  /// [m/s] Rapid feed of the machine by the first model that states its axes; 0: none does.
  double rapid() const;
  double acceleration() const;  ///< [m/s2] of the axes, in the same way
  /// The models that have been requested, by tool number.
  const std::map<int, MachineModel>& models() const { return models_; }

 private:
  const MachineAxes* axes() const;

  std::map<int, MachineModel> models_;
  std::map<int, ToolShape> shapes_;
  std::optional<MachineModel> only_;  // belongs to the first tool that is requested
};

}  // namespace smartmill::program
