#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "smartmill_core/cutting/corner.h"
#include "smartmill_core/cutting/rigid_cut.h"
#include "smartmill_sim/twin/milling_process.h"

namespace smartmill::sim {

/// Response of the tip to the force of the present step.
struct TipMobility {
  std::array<double, 2> assumed_force{
      {0, 0}};  ///< [N] cutting force on which the rate in the motion is based
  std::array<double, 2> rate_per_force{{0, 0}};  ///< [m/s/N] change of the rate per newton
};

/// Cutting force of a tool: one straight mill or, for edges that are not straight, a stack of straight mills
/// (EdgeSlice).
class Cutter {
 public:
  /// How the forces are computed.
  enum class Method {
    history,  ///< from the history of the tool's motion and vibration (MillingProcess)
    tables    ///< from tables over a revolution (RigidCut): steady and rigid
  };

  /// @param radius_offset [m] of each tooth @throws Error on an invalid tool.
  Cutter(const ToolGeometry& tool, const CuttingLaw& law, double time_step,
         const std::vector<double>& radius_offset, double path_share, Method method,
         int corner_slices = CORNER_SLICES);

  /// Sets the contact from now on, see MillingProcess and RigidCut.
  void engage(const std::vector<ContactArc>& arcs, const ToolMotion& now);
  /// The same arcs with other depths.
  void setDepths(const std::vector<ContactArc>& arcs);
  void setLaw(const CuttingLaw& law);
  /// Other radii of the teeth from now on, see MillingProcess. @throws Error with tables.
  void setRadii(const std::vector<double>& radius_offset);

  Method method() const { return method_; }
  /// With tables or a prescribed motion of the tip: record the sums of each further step, or replay sums that
  /// a cutter with other coefficients and factors of the law recorded over the same steps. @param sums must
  /// outlive the steps
  void recordSums(std::vector<CutSums>* sums) { recorded_ = sums; }
  void replaySums(const std::vector<CutSums>* sums) { replayed_ = sums; }

  /// Force on the tool with the tip displaced as in this motion. With a mobility the rate of the tip is
  /// solved together with the force: otherwise rubbing edges would excite a light mode that they damp.
  CuttingForce step(const ToolMotion& now, const TipMobility& mobility = {});
  /// Ends the step. @param displacement [m] of the tip
  void endStep(const std::array<double, 2>& displacement);

 private:
  struct StraightMill {
    EdgeSlice slice;
    EdgeSlice actual;  // means over the engaged height
    std::optional<MillingProcess> process;
    std::optional<RigidCut> rigid;
    std::size_t arcs = 0;  // number of arcs at this height
    CutSums sums;          // of the present step
  };
  void addMills(double height);
  void updateContacts();
  void updateContact(StraightMill& mill);
  ToolMotion motionOf(const StraightMill& mill, const ToolMotion& now) const;
  CutSums sumsOf(StraightMill& mill, const ToolMotion& now) const;
  CuttingForce force() const;  // from the sums
  void solveRubbing(const ToolMotion& now, const TipMobility& mobility);

  ToolGeometry tool_;
  Method method_;
  double time_step_, path_share_;
  int corner_slices_;
  std::vector<double> radius_offset_;  // [m] of each tooth
  CuttingLaw law_;
  std::vector<StraightMill> mills_;
  std::vector<ContactArc> arcs_;
  ToolMotion now_;
  std::vector<CutSums>* recorded_ = nullptr;
  const std::vector<CutSums>* replayed_ = nullptr;
  std::size_t replay_index_ = 0;  // next index in replayed_
  bool arcs_changed_ = false;     // the arcs differ from those of the last step
};

}  // namespace smartmill::sim
