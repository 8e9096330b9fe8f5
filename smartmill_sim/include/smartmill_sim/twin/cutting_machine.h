#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_sim/effects/effect_set.h"
#include "smartmill_sim/twin/cutter.h"
#include "smartmill_sim/twin/edge_layers.h"
#include "smartmill_sim/twin/measuring_chain.h"
#include "smartmill_sim/twin/tip_structure.h"
#include "smartmill_sim/twin/tip_trajectory.h"
#include "smartmill_sim/twin/tool_contact.h"

namespace smartmill::sim {

/// How the tool is fed. steady: speed, feed and contact are constant while the tool cuts (a record of a
/// campaign); without tool-tip modes the forces then come from tables over a revolution.
enum class Feed { any, steady };

/// Result of cut and tool structure in each step, before sensors, drive and signals.
struct CutTrace {
  struct Step {
    CuttingForce force;
    std::array<double, 2> displacement{{0, 0}};  ///< [m] of the tip
    double acceleration = 0.0;                   ///< [m/s2] at the probe
  };
  /// For a tool without modes or with a prescribed motion of the tip; coefficients and factors of the law and
  /// the response of the tip are applied on replay.
  std::vector<CutSums> sums;
  std::vector<Step> steps;  ///< for other tools
};

/// Cutting process, tool structure, force sensor, spindle drive and measuring chain of one machine with the
/// effects of its model, in constant time steps.
class CuttingMachine {
 public:
  /// Input over one step.
  struct Input {
    ToolMotion motion;  ///< displacement and rate are ignored: they follow from the structure
    std::array<double, 2> tip_force{{0, 0}};  ///< [N] force on the tool in addition to cutting (a hammer)
    std::array<double, 3> sensor_force{{0, 0, 0}};  ///< [N] force on the sensor in addition to cutting
    Axes3 axis_acceleration{{0, 0, 0}};             ///< [m/s2] of the machine axes
    /// Prescribed motion of the tip: the chip follows from it instead of the structure's response.
    std::optional<TipMotion> tip;
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
  bool vibrates() const { return tip_.vibrates(); }

  /// Changes the contact of tool and material, see MillingProcess.
  /// @param rise [1] share of the change in force that is linear over the step that ends now; the rest is a
  /// jump at its end.
  void engage(const std::vector<ContactArc>& arcs, const ToolMotion& now, double rise = 1.0);
  bool cutting() const { return contact_.cutting(); }
  /// Sets the axial depth [m] > 0 of every arc; the surface is unchanged. @param passed_over [m] feed path
  /// that is skipped
  void setDepth(double depth, double passed_over = 0.0);

  /// Starts a record: drift and hum restart. A new edge has edge_time 0.
  void setClock(const Clock& clock);

  /// The signal stage at the present instant.
  SignalStage signalStage() { return {effects_, now_}; }

  /// Displacement and acceleration sensors are at the tip, in x (0) or y (1).
  void setProbe(std::size_t axis) { probe_ = axis; }

  /// The input of every step will prescribe the motion of the tip.
  void prescribeTip() { tip_prescribed_ = true; }

  /// From here on the trace of cut and tool is recorded, or replayed from a machine that recorded it over the
  /// same steps and differs only in later stages (without modes or with a prescribed motion of the tip: also
  /// in coefficients and factors of the law and in the tool's modes). @param trace must outlive the steps
  void recordTrace(CutTrace* trace) {
    recorded_ = trace;
    if (tracesSums()) cutter_->recordSums(&trace->sums);
  }
  void replayTrace(const CutTrace* trace) {
    replayed_ = trace;
    if (tracesSums()) cutter_->replaySums(&trace->sums);
  }

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
  // Stages of a step, in this order.
  void applyEffects(const Input& input);  // state of the effects
  CuttingForce cuttingForce(const Input& input);
  void updateTip(const Input& input, Output& out);
  void integrateTip(const Input& input, Output& out);
  void endStep(const CuttingForce& force);
  void advanceTime(const ToolMotion& motion, std::size_t steps = 1);
  // The same stages for many steps.
  struct History : ForceHistory {
    std::vector<Instant> instants;  // where effects need them
  };
  void simulateCut(std::size_t steps, const std::function<void(std::size_t, Input&)>& next,
                   const ChannelRows& raw, History& history);
  bool replaysWithoutUpdates() const;
  void replayRest(std::size_t from, const ChannelRows& raw, History& history);
  void applyOutputEffects(const std::vector<Instant>& instants, const ChannelRows& raw) const;

  bool rigid() const { return cutter_ && cutter_->method() == Cutter::Method::tables; }
  bool tracesSums() const { return cutter_ && (rigid() || tip_prescribed_); }
  // Whether cut and tool are replayed step by step from a trace.
  bool replaysTrace() const { return replayed_ && !tracesSums(); }
  void setActualDepths();

  EffectSet effects_;
  MachineModel model_;  // as changed by the effects
  double time_step_;
  TwinState nominal_, state_;
  Instant now_;
  Clock clock_;
  int steps_to_update_ = 0;
  ToolContact contact_;
  std::optional<Cutter> cutter_;
  EdgeLayers layers_;
  TipStructure tip_;
  MeasuringChain chain_;
  CuttingForce last_;  // at the last step
  bool tip_prescribed_ = false;
  CutTrace* recorded_ = nullptr;
  const CutTrace* replayed_ = nullptr;
  std::size_t replay_index_ = 0;  // next step of replayed_
  std::optional<std::size_t> probe_;
};

}  // namespace smartmill::sim
