#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "smartmill_core/cutting/chip_rule.h"
#include "smartmill_core/cutting/contact_arc.h"
#include "smartmill_core/cutting/cutting_law.h"
#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/math/sine_cosine.h"

namespace smartmill {

/// Sums over the edges in contact. They do not depend on the coefficients and factors of the law, in which
/// the force is linear. With h' and e of CuttingLaw at immersion angles phi:
struct EdgeSums {
  double chip_sine = 0.0, chip_cosine = 0.0, chip = 0.0;  ///< [m2] of h' sin(phi), h' cos(phi), h'
  double edge_sine = 0.0, edge_cosine = 0.0, edge = 0.0;  ///< [m] of e sin(phi), e cos(phi), e
};

/// Force of a tool that does not vibrate at steady speed and feed, from tables over a revolution. The chip of
/// each tooth follows ChipRule (runout, uneven pitch); its elementary forces are integrated over the
/// immersion angle once. The force of an edge is the difference of this integral between its ends in the arc
/// (eq. 3.13..3.15 with any chip).
class RigidCut {
 public:
  /// @param radius_offset [m] of each tooth (runout), empty: none. @param path_share [1] see ChipRule.
  /// @throws Error on an invalid tool.
  RigidCut(const ToolGeometry& tool, const CuttingLaw& law, std::vector<double> radius_offset = {},
           double path_share = 0.0);
  /// One arc. @param feed_direction [rad] from +x towards +y @throws Error also on an invalid engagement.
  RigidCut(const ToolGeometry& tool, const CuttingLaw& law, const Engagement& engagement,
           std::vector<double> radius_offset = {}, double feed_direction = 0.0);

  /// @param feed [m/rad] of the spindle, x and y. @throws Error on an invalid arc.
  void engage(const std::vector<ContactArc>& arcs, const std::array<double, 2>& feed);
  const std::vector<ContactArc>& arcs() const { return arcs_; }
  void setDepths(const std::vector<double>& depths);

  /// New coefficients and factors only scale the tables; parameters of h' and e rebuild them.
  void setLaw(const CuttingLaw& law);

  /// Force on the tool with tooth 1 at an angle [rad].
  CuttingForce at(double angle) { return force(sumsAt(angle)); }
  /// at() in two steps.
  EdgeSums sumsAt(double angle);
  CuttingForce force(const EdgeSums& sums) const {
    const CuttingCoefficients& k = law_.coefficients;
    const double c = law_.chip_factor, e = law_.edge_factor;
    const CuttingForce chip = forceOf(sums.chip_sine, sums.chip_cosine, sums.chip, k.ktc, k.krc, k.kac);
    const CuttingForce edge = forceOf(sums.edge_sine, sums.edge_cosine, sums.edge, k.kte, k.kre, k.kae);
    return {c * chip.fx + e * edge.fx, c * chip.fy + e * edge.fy, c * chip.fz + e * edge.fz,
            c * chip.torque + e * edge.torque};
  }
  /// Chip of a tooth at an immersion angle [m], <= 0: no contact.
  double chip(int tooth, double phi) const;
  /// Forces of the chip coefficients and of the edge coefficients alone, without the factors of the law.
  /// Integrates without tables: faster for fewer than a few thousand angles, and exact where an edge force
  /// begins.
  std::array<CuttingForce, 2> termsAt(double angle) const;
  /// The mean of these over a revolution.
  std::array<CuttingForce, 2> meanTerms() const;

 private:
  void shape();
  void tabulate();
  std::vector<EdgeSums> integrals(std::vector<ChipShape> shapes) const;
  void add(double weight, double thickness, const SineCosine& at, EdgeSums& sums) const;
  void addStraight(const EdgeSegment& part, EdgeSums& sums) const;
  void integrate(const std::vector<ChipShape>& shapes, double from, double to, double height,
                 EdgeSums& sums) const;
  // Sums times coefficients, see EdgeForce::add().
  CuttingForce forceOf(double sine, double cosine, double plain, double tangential, double radial,
                       double axial) const {
    return {-tangential * cosine - radial * sine, tangential * sine - radial * cosine, axial * plain,
            tangential * plain * tool_.radius()};
  }
  std::array<CuttingForce, 2> terms(const EdgeSums& sums) const;
  std::size_t tableOf(int tooth) const { return rule_.alike() ? 0 : static_cast<std::size_t>(tooth); }

  ToolGeometry tool_;
  ChipRule rule_;
  CuttingLaw law_;
  double lag_, path_share_;
  std::vector<ContactArc> arcs_;
  std::array<double, 2> feed_{{0, 0}};  // [m/rad]
  std::vector<std::vector<ChipShape>>
      shapes_;  // surfaces that a tooth may meet; one entry when all teeth are alike
  std::vector<std::vector<EdgeSums>> tables_;  // in the same order: integrals from 0 to each node per height
                                               // of edge in a radian, built when needed
};

}  // namespace smartmill
