#include "smartmill_discrepancy/hypotheses/nominal_freedom.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

struct NominalFreedomOptions {
  /// [1] standard deviations to the bounds: too narrow to hide an effect that the value could replace.
  double reach = 4.5;
  double step = 2e-3;  ///< [1] standard deviations: of numerical derivatives
  /// [1] Path share: bounds beyond both surfaces (0 and 1), step, prior.
  double path_low = -0.5, path_high = 1.5, path_step = 0.02, path_std = 0.5;
  double min_path_deviations = 3.0;  ///< standard deviations from which a path share is written
};

const NominalFreedomOptions LIMITS;

using ModesOf = std::function<std::vector<Mode>&(MachineModel&)>;

const char* const TOOTH_PATH = "empirical:tooth_path";
const char* const PATH_SHARE = "tool.path_share";

bool isToothPath(const EffectEntry& entry) {
  return entry.name == TOOTH_PATH;
}

}  // namespace

NominalFreedom::NominalFreedom(const MachineModel& nominal) {
  if (nominal.cutting) addCutting(nominal);
  addModes(nominal);
  if (nominal.spindle) addSpindle(nominal);
  if (nominal.tool && nominal.cutting) addToothPath();
}

// From the surface rule of formats.md to the true tooth path.
void NominalFreedom::addToothPath() {
  const NominalFreedomOptions& o = LIMITS;
  coordinates_.push_back({PATH_SHARE, 0.0, o.path_low, o.path_high, o.path_step, o.path_std});
  stated_.emplace_back();
  scale_.push_back([](MachineModel& m, double factor) {
    auto path = std::find_if(m.effects.begin(), m.effects.end(), isToothPath);
    if (path == m.effects.end()) {
      m.effects.push_back(effectEntry(TOOTH_PATH, {{"share", 0.0}}));
      path = m.effects.end() - 1;
    }
    path->numbers["share"] += std::log(factor);
  });
}

void NominalFreedom::add(std::string name, double value, double percent, Scale scale) {
  if (value == 0.0 || !std::isfinite(value) || percent <= 0.0) return;
  const double std_dev = 0.01 * percent, reach = LIMITS.reach * std_dev;
  coordinates_.push_back({std::move(name), 0.0, -reach, reach, LIMITS.step * std_dev, std_dev});
  stated_.emplace_back(value);
  scale_.push_back(std::move(scale));
}

std::optional<double> NominalFreedom::stated(std::size_t coordinate) const {
  return stated_.at(coordinate);
}

void NominalFreedom::addCutting(const MachineModel& nominal) {
  for (const CuttingKey& key : cuttingKeys()) {
    const auto c = key.coefficient;
    const double value = (*nominal.cutting).*c;
    double percent = nominal.uncertainty.cutting;
    if (nominal.cutting_std && std::isfinite((*nominal.cutting_std).*c))
      percent = 100.0 * (*nominal.cutting_std).*c / value;
    add(std::string("cutting.") + key.key, value / key.unit, percent,
        [c](MachineModel& m, double factor) { (*m.cutting).*c *= factor; });
  }
}

void NominalFreedom::addModes(const MachineModel& nominal) {
  const Uncertainty& u = nominal.uncertainty;
  MachineModel copy = nominal;
  const auto addAxis = [&](const std::string& name, const ModesOf& of, bool stiffness) {
    const std::vector<Mode>& modes = of(copy);
    for (std::size_t k = 0; k < modes.size(); ++k) {
      const std::string mode = name + "[" + std::to_string(k) + "].";
      add(mode + "frequency_hz", modes[k].frequency, u.frequency,
          [of, k](MachineModel& m, double factor) { of(m)[k].frequency *= factor; });
      add(mode + "damping_ratio", modes[k].damping_ratio, u.damping, [of, k](MachineModel& m, double factor) {
        double& damping = of(m)[k].damping_ratio;
        damping = std::min(damping * factor, 0.99);
      });
      if (!stiffness) continue;
      add(mode + "stiffness_n_per_um", units::UM / modes[k].gain, u.stiffness,
          [of, k](MachineModel& m, double factor) { of(m)[k].gain /= factor; });
    }
  };
  for (std::size_t a = 0; a < 3; ++a) {
    addAxis(
        std::string("force_sensor.") + AXIS_NAMES[a],
        [a](MachineModel& m) -> std::vector<Mode>& { return m.force_sensor.axis[a].modes; }, false);
  }
  addAxis(
      "tool_tip.x", [](MachineModel& m) -> std::vector<Mode>& { return m.tool_tip.x.modes; }, true);
  addAxis(
      "tool_tip.y", [](MachineModel& m) -> std::vector<Mode>& { return m.tool_tip.y.modes; }, true);
}

void NominalFreedom::addSpindle(const MachineModel& nominal) {
  const double percent = nominal.uncertainty.spindle;
  const auto addValue = [&](const std::string& key, double Spindle::*value) {
    add("spindle." + key, (*nominal.spindle).*value, percent,
        [value](MachineModel& m, double factor) { (*m.spindle).*value *= factor; });
  };
  addValue("viscous_nm_s_per_rad", &Spindle::viscous);
  addValue("coulomb_nm", &Spindle::coulomb);
  addValue("load_meter_v_per_w", &Spindle::load_meter_gain);
  addValue("load_meter_bandwidth_hz", &Spindle::load_meter_bandwidth);
}

MachineModel NominalFreedom::apply(const MachineModel& nominal, const std::vector<double>& values) const {
  MachineModel model = nominal;
  for (std::size_t i = 0; i < scale_.size(); ++i) {
    if (values[i] != 0.0) scale_[i](model, std::exp(values[i]));
  }
  return model;
}

std::optional<std::size_t> NominalFreedom::pathShare() const {
  for (std::size_t k = 0; k < coordinates_.size(); ++k) {
    if (coordinates_[k].name == PATH_SHARE) return k;
  }
  return {};
}

bool NominalFreedom::isPathShareSignificant(double share, double std_dev) const {
  return share >= LIMITS.min_path_deviations * std_dev;
}

void NominalFreedom::writeStdDevs(MachineModel& model, const std::vector<double>& std_devs) const {
  const double none = std::numeric_limits<double>::quiet_NaN();
  CuttingCoefficients stds{none, none, none, none, none, none};
  for (std::size_t i = 0; i < coordinates_.size(); ++i) {
    for (const CuttingKey& key : cuttingKeys()) {
      if (coordinates_[i].name == std::string("cutting.") + key.key)
        stds.*key.coefficient = std_devs[i] * (*model.cutting).*key.coefficient;
    }
    const auto path = std::find_if(model.effects.begin(), model.effects.end(), isToothPath);
    if (coordinates_[i].name != PATH_SHARE || path == model.effects.end()) continue;
    path->std_devs["share"] = std_devs[i];
    if (!isPathShareSignificant(path->numbers["share"], std_devs[i])) model.effects.erase(path);
  }
  if (model.cutting) model.cutting_std = stds;
}

const EffectEntry* toothPathOf(const MachineModel& model) {
  const auto path = std::find_if(model.effects.begin(), model.effects.end(), isToothPath);
  return path == model.effects.end() ? nullptr : &*path;
}

}  // namespace smartmill::discrepancy
