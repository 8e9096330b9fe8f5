#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_sim/twin/cutting_parts.h"

namespace smartmill::sim {

/// Cutting process, tool structure, force sensor, spindle drive and measuring chain of one machine with the
/// effects of its model, in constant time steps.
class CuttingMachine {
 public:
  using Input = CuttingInput;
  using Clock = EffectTimeline::Clock;
  /// Output at the end of a step.
  struct Output {
    CuttingForce force;                          ///< cutting force on the tool
    std::array<double, 3> applied{{0, 0, 0}};    ///< [N] force on the sensor, sign of a force on the tool
    std::array<double, 3> sensor{{0, 0, 0}};     ///< [N] signal of the force sensor, without noise
    std::array<double, 2> displacement{{0, 0}};  ///< [m] measured displacement of the tip
    double load_meter = 0.0;                     ///< [V] before rounding; 0 without a spindle section
    ChannelValues raw{};  ///< channels before the signal stage (drift, hum, saturation)
  };
  /// Without tool and cutting sections engage() throws.
  /// @param time_step [s] > 0 @throws Error naming what this twin does not support in the model.
  CuttingMachine(const MachineModel& model, double time_step, Feed feed = Feed::any,
                 int corner_slices = CORNER_SLICES);

  /// The model as changed by its effects.
  const MachineModel& model() const { return parts_.model; }
  /// Whether the tip has modes, so that the chip regenerates.
  bool vibrates() const { return parts_.cut.vibrates(); }

  /// Changes the contact of tool and material, see MillingProcess.
  /// @param rise [1] share of the change in force that is linear over the step that ends now; the rest is a
  /// jump at its end.
  void engage(const std::vector<ContactArc>& arcs, const ToolMotion& now, double rise = 1.0);
  bool cutting() const { return parts_.cut.contact.cutting(); }
  /// Sets the axial depth [m] > 0 of every arc; the surface is unchanged. @param passed_over [m] feed path
  /// that is skipped
  void setDepth(double depth, double passed_over = 0.0);

  /// Breaks the teeth off from now on; surfaces that they have left remain until they are cut away. For
  /// Feed::any. @param shortening [m] of each tooth's radius from that of the model @throws Error when it is
  /// not one for each tooth.
  void shortenTeeth(const std::vector<double>& shortening) { parts_.cut.shortenTeeth(shortening); }

  /// Starts a record: drift and hum restart. A new edge has edge_time 0.
  void setClock(const Clock& clock) { parts_.timeline.setClock(clock); }
  const Clock& clock() const { return parts_.timeline.clock(); }

  /// The signal stage at the present instant.
  SignalStage signalStage() { return parts_.timeline.signalStage(); }

  /// Displacement and acceleration sensors are at the tip, in x (0) or y (1).
  void setProbe(std::size_t axis) { parts_.cut.setProbe(axis); }

  /// The input of every step will prescribe the motion of the tip.
  void prescribeTip() { parts_.cut.prescribeTip(); }

  /// From here on the trace of cut and tool is recorded, or replayed from a machine that recorded it over the
  /// same steps and differs only in later stages (without modes or with a prescribed motion of the tip: also
  /// in coefficients and factors of the law and in the tool's modes). @param trace must outlive the steps
  void recordTrace(CutTrace* trace) { parts_.cut.recordTrace(trace); }
  void replayTrace(const CutTrace* trace) { parts_.cut.replayTrace(trace); }

  /// Of forces and load meter only these channels are simulated; the others are invalid from here on.
  void selectChannels(const std::vector<std::size_t>& channels) { parts_.chain.select(channels); }

  /// Sets the load meter to its steady value in an air cut.
  void resetLoadMeter(double spindle_speed);

  /// The force sensor is turned: step() measures along its own axes. @param to_sensor row-major rotation from
  /// the machine's axes to those of the sensor
  void turnSensor(const std::array<double, 9>& to_sensor) { to_sensor_ = to_sensor; }

  Output step(const Input& input);
  /// As step() above, into an existing Output.
  void step(const Input& input, Output& output);

  /// Simulates many steps at constant speed, without probe and external forces: the same result as step(),
  /// computed stage by stage. @param next updates the input of a step, may call engage() @param raw rows of
  /// one value per step, or nullptr
  void run(std::size_t steps, const std::function<void(std::size_t, Input&)>& next, const ChannelRows& raw);

  /// Voltage rounded to the load meter's resolution [V].
  double rounded(double voltage) const { return parts_.chain.rounded(voltage); }

 private:
  CuttingParts parts_;
  std::optional<std::array<double, 9>> to_sensor_;
};

}  // namespace smartmill::sim
