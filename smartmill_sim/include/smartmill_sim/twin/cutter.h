#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "smartmill_core/cutting/corner.h"
#include "smartmill_core/cutting/rigid_cut.h"
#include "smartmill_sim/twin/milling_process.h"

namespace smartmill::sim {

/// How a tip gives way to the force of the step that is being taken.
struct TipYield {
  std::array<double, 2> assumed{{0, 0}};  ///< [N] force of the cut with which it moves as the motion tells
  std::array<double, 2> rate{{0, 0}};     ///< [m/s/N] that each newton more adds to its rate
};

/// A tool in its work: a straight mill, or, where the tool has a corner radius, one a slice of its height.
class Cutter {
 public:
  /// How the forces come about.
  enum class Way {
    history,  ///< of where the tool was and how it vibrated (MillingProcess)
    tables    ///< over a revolution (RigidCut): steady, nothing vibrates
  };

  /// @param radius_offset [m] of each tooth @param corner_radius [m] 0: none. @throws Error on an impossible
  /// tool or corner.
  Cutter(const ToolGeometry& tool, const CuttingLaw& law, double time_step,
         const std::vector<double>& radius_offset, double corner_radius, double path_share, Way way,
         int corner_slices = CORNER_SLICES);

  /// Where there is material from now on, see MillingProcess and RigidCut.
  void engage(const std::vector<ContactArc>& arcs, const ToolMotion& now);
  /// Depth of each arc [m] > 0.
  void setDepths(const std::vector<double>& depths);
  void setLaw(const CuttingLaw& law);

  Way way() const { return way_; }
  /// Of tables, or where something else displaces the tip: from here on the sums of each step are kept, or
  /// taken from what was kept over the same steps by a cutter that differed in coefficients and factors of
  /// the law only. @param sums must outlive the steps
  void keep(std::vector<CutSums>* sums) { kept_ = sums; }
  void follow(const std::vector<CutSums>* sums) { followed_ = sums; }

  /// Force on the tool with its tip displaced as in this motion. The rate is the one that comes of this very
  /// force: edges that rub would else drive a light mode that they damp.
  CuttingForce step(const ToolMotion& now, const TipYield& yield = {});
  /// Ends the step with the tip there [m].
  void settle(const std::array<double, 2>& displacement);

 private:
  struct Part {
    EdgeSlice slice;
    double top = 0.0;  // [m] up to which the slice's means hold
    EdgeSlice actual;  // these
    std::optional<MillingProcess> process;
    std::optional<RigidCut> rigid;
    std::size_t arcs = 0;  // in which it stands
    CutSums sums;          // of the step
  };
  void place(Part& part);
  ToolMotion motionOf(const Part& part, const ToolMotion& now) const;
  CutSums sumsOf(Part& part, const ToolMotion& now) const;
  CuttingForce force() const;  // of the sums
  void yieldTo(const ToolMotion& now, const TipYield& yield);

  Way way_;
  double corner_radius_, lag_;
  CuttingLaw law_;
  std::vector<Part> parts_;
  std::vector<ContactArc> arcs_;
  ToolMotion now_;
  std::vector<CutSums>* kept_ = nullptr;
  const std::vector<CutSums>* followed_ = nullptr;
  std::size_t place_ = 0;  // in what is followed
  bool fresh_ = false;     // the arcs are other ones than those of the last step
};

}  // namespace smartmill::sim
