#pragma once

#include <array>
#include <optional>
#include <vector>

#include "smartmill_core/cutting/contact_arc.h"
#include "smartmill_core/model/effect.h"
#include "smartmill_sim/twin/milling_process.h"

namespace smartmill::sim {

constexpr double SMALLEST_DEPTH = 1e-9;  ///< [m] of a cut, instead of a depth <= 0

/// Contact of tool and material as commanded, and as the effects of the model change it.
class ToolContact {
 public:
  /// Changes the contact, see CuttingMachine::engage().
  void engage(const std::vector<ContactArc>& arcs, const ToolMotion& now, double rise);
  bool cutting() const { return !arcs_.empty(); }
  /// Commanded depth [m] of every arc. @param passed_over [m] feed path that is skipped
  void setDepth(double depth, double passed_over);

  double depth() const { return arcs_.front().depth; }  ///< [m] commanded, of the first arc
  const CutProgress& progress() const { return progress_; }
  /// Commanded feed per tooth [m] of a turning tool.
  double chip(const ToolMotion& motion, int teeth);

  /// Whether the actual depths differ from those of the last actualArcs().
  bool depthsChange(const TwinState& state) const;
  std::vector<ContactArc> actualArcs(const TwinState& state);
  ToolMotion actualMotion(const ToolMotion& commanded, const TwinState& state) const;

  /// Share [1] of the change in force that is a jump at this step.
  double jump() const { return jump_; }
  /// Whether contact began or ended since the last step.
  bool changed() const { return changed_; }
  void endStep() {
    jump_ = 0.0;
    changed_ = false;
  }
  /// Advances the cut by a time [s].
  void advance(double time, const ToolMotion& motion, const TwinState& state);

 private:
  std::vector<ContactArc> arcs_;  // as commanded
  double depth_extra_ = 0.0;      // [m] contained in the present depths
  CutProgress progress_;
  std::optional<std::array<double, 2>> feed_start_;  // [m] start of the feed error
  std::array<double, 3> chip_motion_{{0, 0, 0}};     // velocity and speed that give chip_
  double chip_ = 0.0;                                // [m]
  bool changed_ = false;
  double jump_ = 0.0;
};

}  // namespace smartmill::sim
