#include <cmath>
#include <limits>

#include "smartmill_discrepancy/hypotheses/hypothesis.h"

namespace smartmill::discrepancy {

NominalFreedom::NominalFreedom(const MachineModel& nominal) {
  const auto add = [&](std::string name, double value, double percent,
                       std::function<void(MachineModel&, double)> scale) {
    if (value == 0.0 || !std::isfinite(value) || percent <= 0.0) return;
    const double std_dev = 0.01 * percent;
    // Not far enough to hide an effect that a value could stand for.
    constexpr double REACH = 4.5;
    coordinates_.push_back(
        {std::move(name), 0.0, -REACH * std_dev, REACH * std_dev, 2e-3 * std_dev, std_dev});
    set_.push_back(std::move(scale));
  };
  const Uncertainty& u = nominal.uncertainty;
  if (nominal.cutting) {
    for (const CuttingKey& key : cuttingKeys()) {
      const auto c = key.coefficient;
      const double value = (*nominal.cutting).*c;
      double percent = u.cutting;
      if (nominal.cutting_std && std::isfinite((*nominal.cutting_std).*c))
        percent = 100.0 * (*nominal.cutting_std).*c / value;
      add(std::string("cutting.") + key.key, value, percent,
          [c](MachineModel& m, double factor) { (*m.cutting).*c *= factor; });
    }
  }
  const auto addModes = [&](const std::string& name, const std::vector<Mode>& modes, auto get,
                            bool stiffness) {
    for (std::size_t k = 0; k < modes.size(); ++k) {
      const std::string mode = name + "[" + std::to_string(k) + "].";
      add(mode + "frequency_hz", modes[k].frequency, u.frequency,
          [get, k](MachineModel& m, double factor) { get(m)[k].frequency *= factor; });
      add(mode + "damping_ratio", modes[k].damping_ratio, u.damping,
          [get, k](MachineModel& m, double factor) {
            double& damping = get(m)[k].damping_ratio;
            damping = std::min(damping * factor, 0.99);
          });
      if (stiffness) {
        add(mode + "stiffness_n_per_um", modes[k].gain, u.stiffness,
            [get, k](MachineModel& m, double factor) { get(m)[k].gain /= factor; });
      }
    }
  };
  const char* const AXES[] = {"x", "y", "z"};
  for (std::size_t a = 0; a < 3; ++a) {
    addModes(
        std::string("force_sensor.") + AXES[a], nominal.force_sensor.axis[a].modes,
        [a](MachineModel& m) -> std::vector<Mode>& { return m.force_sensor.axis[a].modes; }, false);
  }
  addModes(
      "tool_tip.x", nominal.tool_tip.x.modes,
      [](MachineModel& m) -> std::vector<Mode>& { return m.tool_tip.x.modes; }, true);
  addModes(
      "tool_tip.y", nominal.tool_tip.y.modes,
      [](MachineModel& m) -> std::vector<Mode>& { return m.tool_tip.y.modes; }, true);
  if (nominal.spindle) {
    const Spindle& s = *nominal.spindle;
    add("spindle.viscous_nm_s_per_rad", s.viscous, u.spindle,
        [](MachineModel& m, double factor) { m.spindle->viscous *= factor; });
    add("spindle.coulomb_nm", s.coulomb, u.spindle,
        [](MachineModel& m, double factor) { m.spindle->coulomb *= factor; });
    add("spindle.load_meter_v_per_w", s.load_meter_gain, u.spindle,
        [](MachineModel& m, double factor) { m.spindle->load_meter_gain *= factor; });
    add("spindle.load_meter_bandwidth_hz", s.load_meter_bandwidth, u.spindle,
        [](MachineModel& m, double factor) { m.spindle->load_meter_bandwidth *= factor; });
  }
}

MachineModel NominalFreedom::apply(const MachineModel& nominal, const std::vector<double>& values) const {
  MachineModel model = nominal;
  for (std::size_t i = 0; i < set_.size(); ++i) {
    if (values[i] != 0.0) set_[i](model, std::exp(values[i]));
  }
  return model;
}

void NominalFreedom::writeStdDevs(MachineModel& model, const std::vector<double>& std_devs) const {
  if (!model.cutting) return;
  const double none = std::numeric_limits<double>::quiet_NaN();
  CuttingCoefficients stds{none, none, none, none, none, none};
  for (std::size_t i = 0; i < coordinates_.size(); ++i) {
    for (const CuttingKey& key : cuttingKeys()) {
      if (coordinates_[i].name == std::string("cutting.") + key.key)
        stds.*key.coefficient = std_devs[i] * (*model.cutting).*key.coefficient;
    }
  }
  model.cutting_std = stds;
}

}  // namespace smartmill::discrepancy
