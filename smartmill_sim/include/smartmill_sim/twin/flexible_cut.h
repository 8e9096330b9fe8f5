#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

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

/// Cut of a tool whose tip may vibrate, in constant time steps: contact, cutting force and tool structure.
/// Calls per step: force(), moveTip(), endStep(), advance().
class FlexibleCut {
 public:
  /// Input over one step.
  struct Input {
    ToolMotion motion;  ///< displacement and rate are ignored: they follow from the structure
    std::array<double, 2> tip_force{{0, 0}};  ///< [N] force on the tool in addition to cutting (a hammer)
    /// Prescribed motion of the tip: the chip follows from it instead of the structure's response.
    std::optional<TipMotion> tip;
  };

  /// Without tool and cutting sections it cannot engage. @param law without effects
  FlexibleCut(const TwinSetup& setup, const CuttingLaw& law, double time_step, Feed feed, int corner_slices);

  bool vibrates() const { return tip_.vibrates(); }
  /// Changes of the law by the effects.
  void update(const TwinState& state);

  /// Radii of the teeth from now on. @param shortening [m] of each tooth, from the radii of the setup
  /// @throws Error with tables, without a tool or when it is not one for each tooth.
  void shortenTeeth(const std::vector<double>& shortening);

  ToolContact contact;
  /// Applies a changed contact to the tool.
  void engage(const ToolMotion& now, const TwinState& state);
  /// Applies changed depths to the tool.
  void updateDepths(const TwinState& state);

  CuttingForce force(const Input& input, const TwinState& state);
  /// Displacement of the tip and signals of the sensors there.
  void moveTip(const Input& input, const CuttingForce& force, ChannelValues& channels);
  void endStep(const CuttingForce& force);
  const CuttingForce& last() const { return last_; }  ///< at the last step

  // See CuttingMachine.
  void setProbe(std::size_t axis) { probe_ = axis; }
  void prescribeTip() { tip_prescribed_ = true; }
  void recordTrace(CutTrace* trace);
  void replayTrace(const CutTrace* trace);
  void reserveTrace(std::size_t steps);
  /// Whether a trace contains all that the tool needs if the effects' state is constant.
  bool replaysAlone() const { return replayed_ && layers_.empty() && !probe_; }
  /// Replays the steps of a continuing cut from one on. @param rows of the tip's displacement are filled
  void replay(std::size_t from, ForceHistory& history, const ChannelRows& rows);

 private:
  bool rigid() const { return cutter_ && cutter_->method() == Cutter::Method::tables; }
  bool tracesSums() const { return cutter_ && (rigid() || tip_prescribed_); }
  // Whether cut and tool are replayed step by step from a trace.
  bool replaysTrace() const { return replayed_ && !tracesSums(); }
  void integrateTip(const Input& input, const CuttingForce& force, ChannelValues& channels);

  std::optional<Cutter> cutter_;
  std::vector<double> radius_offset_;  // [m] of the setup
  EdgeLayers layers_;
  TipStructure tip_;
  CuttingForce last_;
  bool tip_prescribed_ = false;
  CutTrace* recorded_ = nullptr;
  const CutTrace* replayed_ = nullptr;
  std::size_t replay_index_ = 0;  // next step of replayed_
  std::optional<std::size_t> probe_;
};

}  // namespace smartmill::sim
