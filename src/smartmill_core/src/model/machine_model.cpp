#include "smartmill_core/model/machine_model.h"

#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/range.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

template <typename Section>
const Section& need(const std::optional<Section>& section, const MachineModel& model, const char* name,
                    const std::string& why) {
  if (!section) throw Error(model.file + ": " + name + " is missing (needed to " + why + ")");
  return *section;
}

/// Modes between two places, of which both have as many.
ModalModel between(const ModalModel& from, const ModalModel& to, double share) {
  const auto linear = [share](double a, double b) { return (1.0 - share) * a + share * b; };
  ModalModel model = from;
  for (std::size_t k = 0; k < model.modes.size(); ++k) {
    const Mode &a = from.modes[k], &b = to.modes[k];
    Mode& mode = model.modes[k];
    mode.frequency = linear(a.frequency, b.frequency);
    mode.damping_ratio = linear(a.damping_ratio, b.damping_ratio);
    const double shape =
        linear(a.frequency * std::sqrt(a.gain), b.frequency * std::sqrt(b.gain)) / mode.frequency;
    mode.gain = shape * shape;
    mode.frequency_std = linear(a.frequency_std, b.frequency_std);
    mode.damping_ratio_std = linear(a.damping_ratio_std, b.damping_ratio_std);
    mode.gain_std = mode.gain * linear(a.gain_std / a.gain, b.gain_std / b.gain);
  }
  return model;
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

WorkpieceModes MachineModel::workpieceModes() const {
  if (workpiece_modes.size() > 1) {
    throw Error(file + ": workpiece.modes: " + std::to_string(workpiece_modes.size()) +
                " places, expected a position along the part");
  }
  return workpiece_modes.empty() ? WorkpieceModes{} : workpiece_modes.front();
}

MachineModel atPosition(MachineModel model, double position) {
  const std::vector<WorkpieceModes>& places = model.workpiece_modes;
  if (places.empty())
    throw Error(model.file + ": workpiece.modes is missing (needed for a position along the part)");
  const double low = places.front().position, high = places.back().position;
  if (!(position >= low && position <= high)) {
    throw Error(model.file + ": workpiece.modes: position " + shortNumber(position / units::MM) +
                " mm is outside the places (" + shortNumber(low / units::MM) +
                " <= value <= " + shortNumber(high / units::MM) + ")");
  }
  std::size_t i = 0;
  while (i + 2 < places.size() && places[i + 1].position < position) ++i;
  WorkpieceModes at = places[i];
  if (places.size() > 1) {
    const WorkpieceModes& next = places[i + 1];
    const double share = (position - at.position) / (next.position - at.position);
    at = {position, between(at.x, next.x, share), between(at.y, next.y, share)};
  }
  model.workpiece_modes = {at};
  return model;
}

}  // namespace smartmill
