#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "smartmill_core/cutting/chip_rule.h"
#include "smartmill_core/cutting/contact.h"
#include "smartmill_core/cutting/cutting_law.h"
#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/cutting/rigid_cut.h"
#include "smartmill_core/cutting/tool.h"

namespace smartmill::sim {

/// Where the tool is and how it moves.
struct ToolMotion {
  double angle = 0.0;                          ///< [rad] immersion angle of tooth 1 at its tip
  double speed = 0.0;                          ///< [rad/s] of the spindle, >= 0
  std::array<double, 2> centre{{0, 0}};        ///< [m] x, y of the undeflected tool
  std::array<double, 2> velocity{{0, 0}};      ///< [m/s] of the undeflected tool
  std::array<double, 2> displacement{{0, 0}};  ///< [m] vibration of the tip
  std::array<double, 2> rate{{0, 0}};          ///< [m/s] of the displacement
};

/// Edges that rub on the work (process damping): sums over their length in contact [m] of their rate across
/// the work, over the cutting speed, times sin(phi), cos(phi), 1.
struct RubbingSums {
  double sine = 0.0, cosine = 0.0, plain = 0.0;
};

/// What of the edges is in contact at a step, in which the force is linear: no coefficient nor factor of the
/// law enters.
struct CutSums {
  EdgeSums edges;
  RubbingSums rubbing;  ///< of laws with damping
};

/// [m/rad] Feed of a turn of the spindle. @throws Error when the spindle stands.
std::array<double, 2> feedOf(const ToolMotion& motion);

/// Milling in steps of constant length: every tooth meets what the teeth before it left by ChipRule, from the
/// history of where the tool was and how its tip was displaced. Regeneration, loss of contact, runout and
/// uneven pitch come out of it, and speed, feed and contact may change at any time (Dunwoody 2.2, 6.1 with
/// exact kinematics). Each pass is one ChipShape for the whole edge, so that the force is integrated between
/// the exact ends of every contact; passes are looked at from the last one back until none can be nearer.
class MillingProcess {
 public:
  /// @param time_step [s] > 0 @param radius_offset [m] of each tooth, empty: none. @throws Error on an
  /// impossible tool.
  MillingProcess(const ToolGeometry& tool, const CuttingLaw& law, double time_step,
                 std::vector<double> radius_offset = {}, double path_share = 0.0);

  /// Changes where there is material. Where there was none before, the tool had moved as now and had not
  /// vibrated.
  /// @throws Error on an impossible arc, a standing spindle, a tooth period shorter than two steps.
  void engage(const std::vector<ContactArc>& arcs, const ToolMotion& now);
  const std::vector<ContactArc>& arcs() const { return arcs_; }
  /// Depth of each arc [m] > 0.
  void setDepths(const std::vector<double>& depths);
  void setLaw(const CuttingLaw& law) { law_ = law; }
  /// The force of this tooth alone is given from here on; all of them cut.
  void showOnly(int tooth) { only_tooth_ = tooth; }

  /// Force on the tool with its tip displaced as in this motion.
  CuttingForce step(const ToolMotion& now) { return force(sumsAt(now)); }
  /// The same in two steps.
  CutSums sumsAt(const ToolMotion& now);
  CuttingForce force(const CutSums& sums) const;
  /// Of the contact that sumsAt() found, with the tip at another rate [m/s] at a speed [rad/s].
  RubbingSums rubbing(const std::array<double, 2>& rate, double speed) const;
  /// Ends the step with the tip there [m].
  void settle(const std::array<double, 2>& displacement);

 private:
  /// In the history.
  struct Place {
    double ago = 0.0;                 // [steps]
    std::size_t steps = 0;            // ago: the step before it
    std::array<double, 4> weights{};  // of the steps steps + 2, steps + 1, steps, steps - 1 ago
  };
  /// A turn of the spindle back in the history.
  struct Delay {
    double turn = 0.0;  // [rad]
    Place at;
    long of_regime = -1;                   // for which these hold
    long of_step = -1;                     // for which the rest holds
    bool known = false;                    // the history reaches back to it
    std::array<double, 2> displacement{};  // [m] then
    std::array<double, 2> fed{};           // [m] since then
  };
  /// An earlier pass as one tooth meets it.
  struct Pass {
    std::size_t delay = 0;
    double step = 0.0;    // [m] of the radii, over that of the first pass
    long of_regime = -1;  // for which the shapes hold
    ChipShape still;      // the chip without vibration
    ChipShape behind;     // by how much it is thicker than that of the first pass
    double bend = 0.0;    // of behind
    double beside = 0.0;  // [rad] by which its tooth stood beside the ray when it was last met
  };
  void clear(const ToolMotion& now);
  void advance(const ToolMotion& now);
  bool steadySince(double turn) const;
  Pass& passOf(int tooth, int n) {
    std::vector<Pass>& passes = passes_[static_cast<std::size_t>(tooth)];
    if (passes.size() < static_cast<std::size_t>(n)) addPass(tooth);
    Pass& pass = passes[static_cast<std::size_t>(n) - 1];
    if (pass.of_regime != regime_ || regime_ != 0) shapePass(tooth, n, pass);
    return pass;
  }
  const Delay& back(std::size_t delay) {
    return delays_[delay].of_step == count_ ? delays_[delay] : lookBack(delays_[delay]);
  }
  void addPass(int tooth);
  Delay& lookBack(Delay& delay);
  static Place placeOf(double steps);
  static std::array<double, 4> slopesOf(const Place& at);
  template <class Step>
  void forEachStep(const Place& at, Step&& step) const;
  void search(Delay& delay);
  void shapePass(int tooth, int n, Pass& pass);
  double beside(double vibrated, double fed) const;
  double besides(const Delay& delay, const Stretch& cell) const;
  double mostBeside(double turn) const;
  void lookBeside(const Delay& delay, const Delay& first, const Stretch& cell, Pass& pass,
                  ChipShape* shape) const;
  bool gather(int tooth, const Stretch& cell, bool& certain);
  void cut(int tooth, const Stretch& cell, double height, CutSums& sums);
  void add(const ChipShape& shape, const Stretch& over, double height, CutSums& sums);
  void grow();

  ToolGeometry tool_;
  ChipRule rule_;
  CuttingLaw law_;
  double time_step_, lag_;
  double path_share_;  // [1]
  int only_tooth_ = -1;
  std::vector<ContactArc> arcs_;
  ToolMotion now_;
  std::array<double, 2> feed_{{0, 0}}, first_feed_{{0, 0}};  // [m/rad] now, when the material began

  // What was at each step since the material began, newest at count_ - 1; rings.
  std::vector<std::array<double, 2>> displacement_, centre_;  // [m]
  std::vector<double> turned_;                                // [rad] since the first step
  long count_ = 0;
  double turned_now_ = 0.0;
  std::size_t deepest_ = 0;  // steps that were looked back
  // [m] Displacement and its change from step to step, of the ring's length now and of the one before.
  std::array<double, 2> largest_{{0, 0}}, fastest_{{0, 0}};
  double steepest_ = 0.0;  // [m/rad] vibration
  // Speed and feed stay as they are within a regime.
  long regime_ = 0;
  double regime_began_ = 0.0;  // [rad]

  std::vector<std::vector<Pass>> passes_;  // of each tooth
  std::vector<Delay> delays_;
  std::vector<ChipShape> shapes_;  // those that may give a cell's chip
  // [m] Of edges that rub, over their length in contact at this step.
  struct {
    double sine2 = 0.0, sine_cosine = 0.0, cosine2 = 0.0, sine = 0.0, cosine = 0.0;
  } rubs_;
};

}  // namespace smartmill::sim
