#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_sim/effects/effect_set.h"
#include "smartmill_sim/twin/flexible_cut.h"
#include "smartmill_sim/twin/measuring_chain.h"

namespace smartmill::sim {

/// Cutting process, tool structure, force sensor, spindle drive and measuring chain of one machine with the
/// effects of its model, in constant time steps.
class CuttingMachine {
 public:
  /// Input over one step.
  struct Input : FlexibleCut::Input {
    std::array<double, 3> sensor_force{{0, 0, 0}};  ///< [N] force on the sensor in addition to cutting
    Axes3 axis_acceleration{{0, 0, 0}};             ///< [m/s2] of the machine axes
  };
  /// Output at the end of a step.
  struct Output {
    CuttingForce force;                          ///< cutting force on the tool
    std::array<double, 3> applied{{0, 0, 0}};    ///< [N] force on the sensor, sign of a force on the tool
    std::array<double, 3> sensor{{0, 0, 0}};     ///< [N] signal of the force sensor, without noise
    std::array<double, 2> displacement{{0, 0}};  ///< [m] measured displacement of the tip
    double load_meter = 0.0;                     ///< [V] before rounding; 0 without a spindle section
    ChannelValues raw{};  ///< channels before the signal stage (drift, hum, saturation)
  };
  /// Times for effects in time. Live: both times advance from here, edge_time only during cutting.
  struct Clock {
    double start_time = 0.0;  ///< [s] since the machine was cold
    double edge_time = 0.0;   ///< [s] cutting time of the edge
    bool record = false;      ///< a record of a campaign: start_time is constant, edge_time always advances
  };

  /// Without tool and cutting sections engage() throws.
  /// @param time_step [s] > 0 @throws Error naming what this twin does not support in the model.
  CuttingMachine(const MachineModel& model, double time_step, Feed feed = Feed::any,
                 int corner_slices = CORNER_SLICES);

  /// The model as changed by its effects.
  const MachineModel& model() const { return model_; }
  /// Whether the tip has modes, so that the chip regenerates.
  bool vibrates() const { return cut_.vibrates(); }

  /// Changes the contact of tool and material, see MillingProcess.
  /// @param rise [1] share of the change in force that is linear over the step that ends now; the rest is a
  /// jump at its end.
  void engage(const std::vector<ContactArc>& arcs, const ToolMotion& now, double rise = 1.0);
  bool cutting() const { return cut_.contact.cutting(); }
  /// Sets the axial depth [m] > 0 of every arc; the surface is unchanged. @param passed_over [m] feed path
  /// that is skipped
  void setDepth(double depth, double passed_over = 0.0);

  /// Starts a record: drift and hum restart. A new edge has edge_time 0.
  void setClock(const Clock& clock);

  /// The signal stage at the present instant.
  SignalStage signalStage() { return {effects_, now_}; }

  /// Displacement and acceleration sensors are at the tip, in x (0) or y (1).
  void setProbe(std::size_t axis) { cut_.setProbe(axis); }

  /// The input of every step will prescribe the motion of the tip.
  void prescribeTip() { cut_.prescribeTip(); }

  /// From here on the trace of cut and tool is recorded, or replayed from a machine that recorded it over the
  /// same steps and differs only in later stages (without modes or with a prescribed motion of the tip: also
  /// in coefficients and factors of the law and in the tool's modes). @param trace must outlive the steps
  void recordTrace(CutTrace* trace) { cut_.recordTrace(trace); }
  void replayTrace(const CutTrace* trace) { cut_.replayTrace(trace); }

  /// Of forces and load meter only these channels are simulated; the others are invalid from here on.
  void selectChannels(const std::vector<std::size_t>& channels) { chain_.select(channels); }

  /// Sets the load meter to its steady value in an air cut.
  void resetLoadMeter(double spindle_speed);

  Output step(const Input& input);
  /// As step() above, into an existing Output.
  void step(const Input& input, Output& output);

  /// Simulates many steps at constant speed, without probe and external forces: the same result as step(),
  /// computed stage by stage. @param next updates the input of a step, may call engage() @param raw rows of
  /// one value per step, or nullptr
  void run(std::size_t steps, const std::function<void(std::size_t, Input&)>& next, const ChannelRows& raw);

  /// Voltage rounded to the load meter's resolution [V].
  double rounded(double voltage) const { return chain_.rounded(voltage); }

 private:
  CuttingMachine(const MachineModel& model, const TwinSetup& setup, double time_step, Feed feed,
                 int corner_slices);

  void update(const ToolMotion& motion);
  void applyEffects(const Input& input);
  void advanceTime(const ToolMotion& motion, std::size_t steps = 1);
  // step() for many steps.
  struct History : ForceHistory {
    std::vector<Instant> instants;  // where effects need them
  };
  void simulateCut(std::size_t steps, const std::function<void(std::size_t, Input&)>& next,
                   const ChannelRows& raw, History& history);
  bool replaysWithoutUpdates() const;
  void applyOutputEffects(const std::vector<Instant>& instants, const ChannelRows& raw) const;

  EffectSet effects_;
  MachineModel model_;  // as changed by the effects
  double time_step_;
  TwinState nominal_, state_;
  Instant now_;
  Clock clock_;
  int steps_to_update_ = 0;
  FlexibleCut cut_;
  MeasuringChain chain_;
};

}  // namespace smartmill::sim
