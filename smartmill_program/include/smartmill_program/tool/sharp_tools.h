#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>

#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::program {

/// Coefficients of a sharp tool.
struct SharpCoefficients {
  CuttingCoefficients value, std_dev;
  std::string source;  ///< model file, or tool and material
};

/// Coefficients of the sharp tools of a machine: those of their models, else the first identified ones of
/// tool and material, since later ones follow the wear. A model is that of a condition whose tool has its
/// geometry and, of several models, its number in the name (toolName()).
class SharpTools {
 public:
  /// @param models by T; 0: the only one, of any name @throws Error when a model has no tool
  explicit SharpTools(std::map<int, MachineModel> models);

  void add(const CoefficientSet& set);
  /// Empty: none is known of this tool in this material.
  std::optional<SharpCoefficients> of(const CuttingCondition& condition) const;
  /// Whether the tool of a condition has a model.
  bool hasModel(const CuttingCondition& condition) const { return modelOf(condition) != nullptr; }
  /// Until a condition states a tool.
  const ToolGeometry& first() const { return *models_.begin()->second.tool; }

 private:
  const MachineModel* modelOf(const CuttingCondition& condition) const;

  std::map<int, MachineModel> models_;
  std::map<std::pair<std::string, std::string>, SharpCoefficients> identified_;  // by tool and material
};

}  // namespace smartmill::program
