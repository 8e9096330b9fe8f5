#pragma once

#include <array>
#include <optional>
#include <vector>

#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_sim/twin/cutting_process.h"
#include "smartmill_sim/twin/spindle_drive.h"

namespace smartmill::sim {

/// Process, tool structure, force sensor and spindle drive of one machine, in steps of constant length.
class CuttingMachine {
 public:
  /// What happens between now and the last step.
  struct Input {
    ToolMotion motion;                              ///< displacement is not read: the structure gives it
    std::array<double, 2> tip_force{{0, 0}};        ///< [N] on the tool besides cutting (a hammer)
    std::array<double, 3> sensor_force{{0, 0, 0}};  ///< [N] on the sensor besides cutting
  };
  /// At the end of a step.
  struct Output {
    CuttingForce force;                          ///< of the cut, on the tool
    std::array<double, 3> applied{{0, 0, 0}};    ///< [N] on the sensor, as force on the tool
    std::array<double, 3> sensor{{0, 0, 0}};     ///< [N] what the sensor shows, without noise
    std::array<double, 2> displacement{{0, 0}};  ///< [m] of the tip
    double load_meter = 0.0;                     ///< [V] before rounding; 0 without a spindle section
  };

  /// Without tool and cutting sections nothing can be cut: engage() then refuses.
  /// @param time_step [s] > 0. @throws Error naming what of the model this twin cannot run.
  CuttingMachine(const MachineModel& model, double time_step);

  /// Changes where the tool meets material, see CuttingProcess.
  void engage(const std::vector<ContactArc>& arcs, const ToolMotion& now);
  bool cutting() const { return process_ && !process_->arcs().empty(); }

  /// The load meter stands at the steady value of cutting air.
  void resetLoadMeter(double spindle_speed);

  Output step(const Input& input);

  /// Rounded to the load meter's resolution [V].
  double rounded(double voltage) const { return drive_ ? drive_->rounded(voltage) : voltage; }

 private:
  std::optional<CuttingProcess> process_;
  std::vector<ModalFilter> tip_;     // x, y
  std::vector<ModalFilter> sensor_;  // x, y, z
  std::optional<SpindleDrive> drive_;
  std::array<std::array<double, 2>, 2> tip_history_{};  // [N] total force on the tip one and two steps ago
  double last_torque_ = 0.0;
  double sign_;
  std::string file_;
};

/// @throws Error naming the first effect of the model, while no effect is simulated.
void refuseEffects(const MachineModel& model);

}  // namespace smartmill::sim
