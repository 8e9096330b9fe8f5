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
#include "smartmill_sim/twin/tool_history.h"

namespace smartmill::sim {

/// Process damping: sums over the edge length in contact [m] of the edge's velocity into the work over the
/// cutting speed, times sin(phi), cos(phi), 1.
struct RubbingSums {
  double sine = 0.0, cosine = 0.0, plain = 0.0;
};

/// Sums over the edges in contact at a step, in which the force is linear; independent of coefficients and
/// factors of the law.
struct CutSums {
  EdgeSums edges;
  RubbingSums rubbing;  ///< for laws with damping
};

/// Milling in constant time steps: every tooth cuts the surface left by earlier teeth (ChipRule), from the
/// history of position and deflection of the tool. This includes regeneration, loss of contact, runout and
/// variable pitch; speed, feed and contact may change at any time (Dunwoody 2.2, 6.1 with exact kinematics).
/// Each earlier pass is one ChipShape for the whole edge, so that the force is integrated between the exact
/// ends of every contact. Passes are considered from the last one back until no older pass can be nearer.
class MillingProcess {
 public:
  /// @param time_step [s] > 0 @param radius_offset [m] of each tooth, empty: none @throws Error on an invalid
  /// tool.
  MillingProcess(const ToolGeometry& tool, const CuttingLaw& law, double time_step,
                 std::vector<double> radius_offset = {}, double path_share = 0.0);

  /// Changes the contact. At a first contact the earlier motion is the present one without vibration.
  /// @throws Error on an invalid arc, a spindle at rest, a tooth period shorter than two steps.
  void engage(const std::vector<ContactArc>& arcs, const ToolMotion& now);
  /// Depth of each arc [m] > 0.
  void setDepths(const std::vector<double>& depths);
  void setLaw(const CuttingLaw& law) { law_ = law; }
  /// The teeth have other radii from now on; surfaces that they have left remain until they are cut away.
  /// @param radius_offset [m] of each tooth, empty: none @throws Error on another number.
  void setRadii(std::vector<double> radius_offset);
  /// The edge is inclined: an axial feed advances it across the tool by this share [1] (EdgeSlice::lean()).
  void setLean(double lean) { lean_ = lean; }
  /// From here on returns the force of this tooth alone; all teeth cut.
  void selectTooth(int tooth) { only_tooth_ = tooth; }

  /// Force on the tool with the tip displaced as in this motion.
  CuttingForce step(const ToolMotion& now) { return force(sumsAt(now)); }
  /// Parts of step(): sums over the edges, and their force.
  CutSums sumsAt(const ToolMotion& now);
  CuttingForce force(const CutSums& sums) const;
  /// Sums for the contact of the last sumsAt() with another rate of the tip [m/s], at a speed [rad/s].
  RubbingSums rubbing(const std::array<double, 2>& rate, double speed) const;
  /// Ends the step. @param displacement [m] of the tip
  void endStep(const std::array<double, 2>& displacement);

 private:
  /// Surface of an earlier pass as one tooth meets it.
  struct Pass {
    std::size_t delay = 0;
    double step = 0.0;       // [m] difference of the radii, relative to the first pass
    long valid_regime = -1;  // regime of the shapes
    ChipShape rigid;         // the chip without vibration
    ChipShape excess;        // excess of the chip thickness over the first pass
    double bend = 0.0;       // curvature bound of excess
    double offset = 0.0;     // [rad] angle of its tooth off the ray, solved at the last contact
  };
  Pass& passOf(int tooth, int n) {
    std::vector<Pass>& passes = passes_[static_cast<std::size_t>(tooth)];
    if (passes.size() < static_cast<std::size_t>(n)) addPass(tooth);
    Pass& pass = passes[static_cast<std::size_t>(n) - 1];
    if (pass.valid_regime != history_.regime() || history_.regime() != 0 || !earlier_radii_.empty())
      shapePass(tooth, n, pass);
    return pass;
  }
  /// Radii of the teeth until a change.
  struct EarlierRadii {
    double until = 0.0;               // [rad] rotation of the history
    std::vector<double> lengthening;  // [m] radius until then minus the present one, of each tooth
  };
  double lengthening(int tooth, int n) const;
  double overhang(int tooth) const;
  void forgetRadii();
  double axialChip(int tooth, int n) const;
  void addPass(int tooth);
  void shapePass(int tooth, int n, Pass& pass);
  double pathMargin(double vibrated, double fed) const;
  double pathMarginAt(const ToolHistory::Delay& delay, const AngleInterval& cell) const;
  double largestPathMargin(double turn) const;
  void correctForPath(const ToolHistory::Delay& delay, const ToolHistory::Delay& first,
                      const AngleInterval& cell, Pass& pass, ChipShape* shape) const;
  bool collectShapes(int tooth, const AngleInterval& cell, bool& certain);
  void cut(int tooth, const AngleInterval& cell, double height, CutSums& sums);
  void add(const ChipShape& shape, const AngleInterval& over, double height, CutSums& sums);

  ToolGeometry tool_;
  ChipRule rule_;
  std::vector<double> radius_offset_;  // [m] of each tooth
  CuttingLaw law_;
  double time_step_, lag_;
  double path_share_;  // [1] weight of the path correction
  double lean_ = 0.0;  // [1]
  int only_tooth_ = -1;
  std::vector<ContactArc> arcs_;
  ToolHistory history_;
  std::vector<std::vector<Pass>> passes_;    // of each tooth
  std::vector<EarlierRadii> earlier_radii_;  // oldest first; empty: no surface of other radii is left
  std::vector<ChipShape> shapes_;            // candidates for the chip of a cell
  // [m] Moments of the rubbing edges over their length in contact at this step.
  struct {
    double sine2 = 0.0, sine_cosine = 0.0, cosine2 = 0.0, sine = 0.0, cosine = 0.0;
  } rubbing_moments_;
};

}  // namespace smartmill::sim
