#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/cutting/friction.h"
#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/model/frame_poses.h"
#include "smartmill_core/model/sensor_channels.h"

namespace smartmill {

using Axes3 = std::array<double, 3>;

/// Modes of the tool tip, receptance [m/N]. An axis that the file omits is rigid.
struct ToolTip {
  ModalModel x, y;
};

/// Force sensor: measured over applied force, static gain 1 (direct = 1 - sum of gains). An axis that the
/// file omits is ideal.
struct ForceSensor {
  ForceSensor() {
    for (ModalModel& a : axis) a.direct = 1.0;
  }
  std::array<ModalModel, 3> axis;
  std::optional<Axes3> noise_rms;   ///< [N]
  bool measures_workpiece = false;  ///< measures the reaction on the workpiece; the sign is reversed on input
  std::optional<SensorChannels> channels;  ///< from which fx, fy, fz follow; nothing: these are measured
  bool mean_samples = false;               ///< a sample is the mean over its interval, not instantaneous
};

/// Spindle friction, load meter and limits.
struct Spindle {
  double viscous = 0.0;                ///< [N m s/rad]
  double coulomb = 0.0;                ///< [N m], any sign
  double load_meter_gain = 0.0;        ///< [V/W]
  double load_meter_bandwidth = 0.0;   ///< [Hz] first order
  double load_meter_resolution = 0.0;  ///< [V]
  double friction_zero_below = 0.0;    ///< [rad/s]
  // For the controller and the chart; all optional in the file.
  std::optional<double> load_meter_full_scale;  ///< [V] displayed as 100 %
  std::optional<double> max_speed;              ///< [rad/s]
  std::optional<double> rated_torque;           ///< [N m]
  std::optional<double> rated_power;            ///< [W]
  std::optional<double> acceleration;           ///< [rad/s2]

  LinearFriction friction() const { return {viscous, coulomb, friction_zero_below}; }
};

/// Linear axes of the machine.
struct MachineAxes {
  std::array<std::array<double, 2>, 3> travel{};  ///< [m] min, max of x, y, z
  double rapid = 0.0;                             ///< [m/s]
  double acceleration = 0.0;                      ///< [m/s2]
  Axes3 home{{0, 0, 0}};                          ///< [m]
};

/// Hammer station: solenoid hammer above a capacitive displacement sensor, on the table (Dunwoody fig. 4.1).
struct HammerStation {
  /// Displacement sensor on the other side of the tool (Dunwoody 7.1): the hammer strikes towards it, at its
  /// height where the offset is zero. Without it the sensor is on the hammer's side, below it.
  struct Opposite {
    double distance = 0.0;  ///< [m] from the sensor's face to the hammer's head at rest
    double stroke = 0.0;    ///< [m] of the head, up to which it reaches a tool
  };

  double offset = 0.0;  ///< [m] hammer's height above the displacement sensor
  std::optional<Opposite> opposite;
  double peak_force = 0.0;       ///< [N]
  double contact_time = 0.0;     ///< [s] of the half-sine hit
  double force_noise_rms = 0.0;  ///< [N]
  double gap_at_zero_volt =
      0.0;  ///< [m] sensor: V = gain_volt (gap_at_zero_volt / gap - 1), clipped to +-range_volt
  double gain_volt = 0.0;          ///< [V]
  double range_volt = 0.0;         ///< [V]
  double voltage_noise_rms = 0.0;  ///< [V]
  double flute_depth = 0.0;        ///< [m] depth of the flutes below the tool's circumference
  /// Tool centre (tip) in machine coordinates at which the sensor of that direction is about twice
  /// gap_at_zero_volt from the tool when a flute faces it. The tool approaches the sensor in the positive
  /// direction.
  std::map<std::string, Axes3> position;  ///< "x", "y" [m]
};

/// Stock on the table (on the force sensor).
struct Workpiece {
  std::string material;
  Axes3 low{{0, 0, 0}}, high{{0, 0, 0}};  ///< [m] corners in machine coordinates of the tool tip
};

/// Modes of the workpiece at one place along the cut, receptance [m/N] where the tool cuts. An axis that the
/// file omits is rigid.
struct WorkpieceModes {
  double position = 0.0;  ///< [m] along the path of the cut
  ModalModel x, y;
};

/// One entry of effects: a name and keys of the catalogue with their values as in the file (shop units).
struct EffectEntry {
  std::string name;
  std::map<std::string, double> numbers;
  std::map<std::string, double> std_devs;    ///< of keys that have a _std key; of list items: pitch_deg[0]
  std::map<std::string, std::string> words;  ///< channel, axis
  std::map<std::string, std::vector<double>> lists;  ///< one value per tooth: pitch_deg
  ToolTip flexibility;                               ///< modes
};

/// Standard deviations of the nominal values [percent].
struct Uncertainty {
  double cutting = 3.0, frequency = 0.5, damping = 10.0, stiffness = 5.0, spindle = 3.0;
};

/// smartmill-model/1: nominal values of one machine, tool and material (formats.md), in SI units. Optional
/// sections are empty when the file omits them.
struct MachineModel {
  std::string file;  ///< for messages
  std::optional<ToolGeometry> tool;
  std::optional<double> stickout;         ///< [m] from the tip to the holder's face
  std::optional<double> edge_height;      ///< [m] of the edges above the tip; empty: no less than any cut
  std::optional<double> holder_diameter;  ///< [m] largest, above the stickout; empty: no holder
  std::optional<CuttingCoefficients> cutting;      ///< NaN: the file omits that key; needCutting() throws
  std::optional<CuttingCoefficients> cutting_std;  ///< NaN: that key has no _std key; empty: none has
  ToolTip tool_tip;
  ForceSensor force_sensor;
  std::optional<Spindle> spindle;
  std::optional<MachineAxes> axes;
  std::optional<HammerStation> hammer;
  std::optional<Workpiece> workpiece;
  std::vector<WorkpieceModes> workpiece_modes;  ///< in the order of the position; empty: a rigid workpiece
  std::vector<EffectEntry> effects;
  Uncertainty uncertainty;
  FramePoses frames;  ///< fixed frames that the file states

  /// A section that a program needs. @throws Error "FILE: NAME is missing (needed to WHY)".
  const ToolGeometry& needTool(const std::string& why) const;
  const CuttingCoefficients& needCutting(const std::string& why) const;
  const Spindle& needSpindle(const std::string& why) const;
  const MachineAxes& needAxes(const std::string& why) const;
  const HammerStation& needHammer(const std::string& why) const;
  const Workpiece& needWorkpiece(const std::string& why) const;
  /// Modes of the workpiece where the tool cuts; without modes those of a rigid one. @throws Error when the
  /// model states several places: at() selects one.
  WorkpieceModes workpieceModes() const;
};

/// The model with the modes of the workpiece at a position [m]. Between two places the frequency, the damping
/// ratio and the mode shape (w sqrt(gain)) of each mode are linear in the position; a standard deviation too
/// where both places state it. @throws Error when the model states no modes of the workpiece, or the position
/// is outside the places.
MachineModel atPosition(MachineModel model, double position);

/// @throws Error of one line that names the file, the key and the value: unknown key, missing key, wrong
/// type, NaN, out of range.
MachineModel readMachineModel(const std::string& file);

class StrictYaml;

/// Reads the keys that state the edges of a tool: helix_deg, corner_radius_mm, edge_angle_deg, serration.
/// @param tool with teeth and diameter
void readEdges(const StrictYaml& map, ToolGeometry& tool);

/// A key of the section `cutting` and its coefficient, in the order of the file.
struct CuttingKey {
  const char* key;
  double CuttingCoefficients::*coefficient;
  double unit;  ///< [N/m2] or [N/m] SI value of one in the file
};
const std::array<CuttingKey, 6>& cuttingKeys();

/// The section `cutting:` with its standard deviations; NaN values are omitted.
std::string cuttingSection(const CuttingCoefficients& value, const CuttingCoefficients& std_dev);

/// Writes the model with the same keys, ten significant digits. @throws Error when the file cannot be
/// written.
void writeMachineModel(const MachineModel& model, const std::string& file);

}  // namespace smartmill
