#include "smartmill_core/model/machine_model.h"

#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

template <typename Section>
const Section& need(const std::optional<Section>& section, const MachineModel& model, const char* name,
                    const std::string& why) {
  if (!section) throw Error(model.file + ": " + name + " is missing (needed to " + why + ")");
  return *section;
}

}  // namespace

const std::array<CuttingKey, 6>& cuttingKeys() {
  static const std::array<CuttingKey, 6> KEYS{
      CuttingKey{"Ktc_n_per_mm2", &CuttingCoefficients::ktc, units::N_PER_MM2},
      CuttingKey{"Krc_n_per_mm2", &CuttingCoefficients::krc, units::N_PER_MM2},
      CuttingKey{"Kac_n_per_mm2", &CuttingCoefficients::kac, units::N_PER_MM2},
      CuttingKey{"Kte_n_per_mm", &CuttingCoefficients::kte, units::N_PER_MM},
      CuttingKey{"Kre_n_per_mm", &CuttingCoefficients::kre, units::N_PER_MM},
      CuttingKey{"Kae_n_per_mm", &CuttingCoefficients::kae, units::N_PER_MM}};
  return KEYS;
}

const ToolGeometry& MachineModel::needTool(const std::string& why) const {
  return need(tool, *this, "tool", why);
}
const CuttingCoefficients& MachineModel::needCutting(const std::string& why) const {
  const CuttingCoefficients& value = need(cutting, *this, "cutting", why);
  for (const CuttingKey& k : cuttingKeys()) {
    if (!std::isfinite(value.*k.coefficient)) {
      throw Error(file + ": cutting." + k.key + " is missing (needed to " + why + ")");
    }
  }
  return value;
}
const Spindle& MachineModel::needSpindle(const std::string& why) const {
  return need(spindle, *this, "spindle", why);
}
const MachineAxes& MachineModel::needAxes(const std::string& why) const {
  return need(axes, *this, "axes", why);
}
const HammerStation& MachineModel::needHammer(const std::string& why) const {
  return need(hammer, *this, "hammer", why);
}
const Workpiece& MachineModel::needWorkpiece(const std::string& why) const {
  return need(workpiece, *this, "workpiece", why);
}

}  // namespace smartmill
