#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_sim/effects/delay_line.h"
#include "smartmill_sim/effects/effect_set.h"
#include "smartmill_sim/effects/shelf_filter.h"
#include "smartmill_sim/twin/cutter.h"
#include "smartmill_sim/twin/edge_layers.h"
#include "smartmill_sim/twin/guide.h"
#include "smartmill_sim/twin/spindle_drive.h"

namespace smartmill::sim {

/// How the tool is fed: steady promises that speed, feed and contact do not change while the tool cuts (a
/// record of a campaign); without tool-tip modes tables over a revolution then give the forces.
enum class Feed { any, steady };

/// What cut and tool do in each step, which no sensor, drive or signal has a part in.
struct CutTrace {
  struct Step {
    CuttingForce force;
    std::array<double, 2> displacement{{0, 0}};  ///< [m] of the tip
    double acceleration = 0.0;                   ///< [m/s2] where a probe stands
  };
  /// Of a tool without modes, or one that is guided: coefficients and factors of the law act later, and what
  /// forces do to the tip.
  std::vector<CutSums> sums;
  std::vector<Step> steps;  ///< of one with modes
};

/// Process, tool structure, force sensor, spindle drive and measuring chain of one machine with the effects
/// that its model lists, in steps of constant length.
class CuttingMachine {
 public:
  /// What happens between now and the last step.
  struct Input {
    ToolMotion motion;                              ///< vibration is not read: the structure gives it
    std::array<double, 2> tip_force{{0, 0}};        ///< [N] on the tool besides cutting (a hammer)
    std::array<double, 3> sensor_force{{0, 0, 0}};  ///< [N] on the sensor besides cutting
    Axes3 axis_acceleration{{0, 0, 0}};             ///< [m/s2] of the machine axes
    /// Where the tip is known to be: the chip is of that, whatever the structure would do.
    std::optional<TipPlace> tip;
  };
  /// At the end of a step.
  struct Output {
    CuttingForce force;                          ///< of the cut, on the tool
    std::array<double, 3> applied{{0, 0, 0}};    ///< [N] on the sensor, as force on the tool
    std::array<double, 3> sensor{{0, 0, 0}};     ///< [N] what the sensor shows, without noise
    std::array<double, 2> displacement{{0, 0}};  ///< [m] of the tip, as its sensor shows it
    double load_meter = 0.0;                     ///< [V] before rounding; 0 without a spindle section
    ChannelValues early{};  ///< the measured channels before the signal stage (drift, hum, saturation)
  };
  /// Of effects in time. Live: the machine counts on from here, the edge's time only while it cuts.
  struct Clock {
    double start_time = 0.0;  ///< [s] since the machine was cold
    double edge_time = 0.0;   ///< [s] that the edge has cut
    bool record = false;      ///< a record of a campaign: start_time stands, edge_time always goes on
  };

  /// Without tool and cutting sections nothing can be cut: engage() then refuses.
  /// @param time_step [s] > 0. @throws Error naming what of the model this twin cannot run.
  CuttingMachine(const MachineModel& model, double time_step, Feed feed = Feed::any,
                 int corner_slices = CORNER_SLICES);

  /// As the effects left it.
  const MachineModel& model() const { return model_; }
  /// Whether the tip has modes: the chip then regenerates.
  bool vibrates() const { return vibrates_; }

  /// Changes where the tool meets material, see MillingProcess.
  /// @param rise [1] share of the change in force that comes on linearly over the step that ends now; the
  /// rest jumps at its end.
  void engage(const std::vector<ContactArc>& arcs, const ToolMotion& now, double rise = 1.0);
  bool cutting() const { return !arcs_.empty(); }
  /// Another axial depth [m] > 0 of every arc, the surface as it is. Feed [m] is passed over unseen.
  void setDepth(double depth, double passed_over = 0.0);

  /// A record begins now: drift and hum start anew. A new edge has edge_time 0.
  void setClock(const Clock& clock);
  const Clock& clock() const { return clock_; }

  /// Tones in the signals (mains hum), their phases to be set by who knows them.
  std::vector<Tone*> tones() { return effects_.tones(); }
  /// Bursts in the signals, the same.
  std::vector<BurstTrain*> bursts() { return effects_.bursts(); }
  /// Early channels to what is shown: drift, hum and saturation at a time since the record began [s].
  void finish(double record_time, ChannelValues& channels) const;
  bool finishes() const { return effects_.has(Stage::signal); }  ///< whether that changes anything

  /// The size that each channel can show at most; infinity: any.
  ChannelValues limits() const { return effects_.limits(); }

  /// Displacement and acceleration sensors stand at the tip, in x (0) or y (1).
  void setProbe(std::size_t axis) { probe_ = axis; }

  /// Every step's input will tell where the tip is.
  void guide() { guided_ = true; }

  /// From here on what cut and tool do is kept; or is taken from what another machine kept over the same
  /// steps, which differed behind the tool only (of a tool without modes, or a guided one: in coefficients
  /// and factors of the law and in the tool's modes too). @param trace must outlive the steps
  void keep(CutTrace* trace) {
    kept_ = trace;
    if (keepsSums()) cutter_->keep(&trace->sums);
  }
  void follow(const CutTrace* trace) {
    followed_ = trace;
    if (keepsSums()) cutter_->follow(&trace->sums);
  }

  /// Of forces and load meter only these are asked for; what the others show means nothing from here on.
  void showOnly(const std::vector<std::size_t>& channels);

  /// The load meter stands at the steady value of cutting air.
  void resetLoadMeter(double spindle_speed);

  Output step(const Input& input);
  /// The same into an Output that earlier steps may have filled.
  void step(const Input& input, Output& output);

  /// Early channels of many steps: a row each, of those that are asked for.
  using EarlyRows = std::array<std::vector<double>*, CHANNEL_COUNT>;
  /// So many steps at one speed, without a probe and with no force from elsewhere: what step() gives, stage
  /// after stage instead of step after step. @param next sets what of an input moves on, may engage()
  /// @param early as long as there are steps, or nullptr
  void run(std::size_t steps, const std::function<void(std::size_t, Input&)>& next, const EarlyRows& early);

  /// Rounded to the load meter's resolution [V].
  double rounded(double voltage) const { return drive_ ? drive_->rounded(voltage) : voltage; }

 private:
  void update(const Input& input);
  // A step, in this order.
  void takeOver(const Input& input);  // what effects set anew
  CuttingForce cut(const Input& input);
  void moveTip(const Input& input, Output& out);
  void settleTip(const Input& input, Output& out);
  void showForce(Output& out);
  void showLoad(double speed, Output& out);
  void passOn(Output& out);  // what effects on channels make of them, in time
  void passTime(const ToolMotion& motion, std::size_t steps = 1);
  // The same stages of many steps.
  struct Course {
    std::array<double, 3> before{{0, 0, 0}};  // [N] force of the cut before the first step
    std::vector<CuttingForce> force;
    std::vector<std::array<double, 3>> applied;         // [N] on the sensor, where it is not the cut's alone
    std::vector<std::pair<std::size_t, double>> jumps;  // steps at which some of the force comes on at once
    std::vector<Instant> instants;                      // where effects ask for them
  };
  void cutAll(std::size_t steps, const std::function<void(std::size_t, Input&)>& next, const EarlyRows& early,
              Course& course);
  bool stepsAlike() const;
  void replay(std::size_t from, const EarlyRows& early, Course& course);
  void showAll(const Course& course, const EarlyRows& early);
  void measureAll(const Course& course, const EarlyRows& early) const;
  void passAllOn(std::size_t steps, const EarlyRows& early);

  bool rigid() const { return cutter_ && cutter_->way() == Cutter::Way::tables; }
  bool keepsSums() const { return cutter_ && (rigid() || guided_); }
  // Cut and tool are taken from a trace, step by step.
  bool replayed() const { return followed_ && !keepsSums(); }
  double actualDepth(double commanded) const;  // [m]
  void setActualDepths();
  ToolMotion fed(const ToolMotion& commanded) const;

  EffectSet effects_;
  MachineModel model_;  // as the effects left it
  double time_step_;
  TwinState nominal_, state_;
  Instant now_;
  Clock clock_;
  int steps_to_update_ = 0;
  std::optional<Cutter> cutter_;
  EdgeLayers layers_;
  bool vibrates_ = false, guided_ = false;
  CutTrace* kept_ = nullptr;
  const CutTrace* followed_ = nullptr;
  std::size_t place_ = 0;  // in what is followed
  std::optional<std::size_t> probe_;
  std::array<bool, 3> shows_force_{{true, true, true}};
  bool shows_load_ = true;
  std::vector<ContactArc> arcs_;                     // as commanded
  double depth_extra_ = 0.0;                         // [m] that the depths hold now
  double feed_path_ = 0.0;                           // [m] since engagement
  double cut_time_ = 0.0;                            // [s] since then
  std::optional<std::array<double, 2>> feed_start_;  // [m] where feed errors begin to count
  std::vector<ModalFilter> tip_;                     // x, y
  std::vector<ModalFilter> sensor_;                  // x, y, z
  double sensor_frequency_ = 1.0;                    // of the first modes now, over the model's
  std::optional<SpindleDrive> drive_;
  std::vector<std::pair<Resonance, ModalFilter>> resonances_;
  std::vector<std::pair<std::size_t, ShelfFilter>> shelves_;
  std::vector<std::pair<std::size_t, DelayLine>> delays_;
  std::array<std::array<double, 2>, 2> tip_history_{};  // [N] total force on the tip one and two steps ago
  std::array<double, 3> last_cut_{{0, 0, 0}};           // [N] force of the cut at the last step
  std::array<double, 3> chip_of_{{0, 0, 0}};            // velocity and speed of which this is the chip:
  double chip_ = 0.0;                                   // [m]
  double last_torque_ = 0.0;
  bool engaged_ = false;  // or left the cut since the last step
  double jump_ = 0.0;     // [1] share of the change in force that comes on at once at this step
  double sign_;
};

}  // namespace smartmill::sim
