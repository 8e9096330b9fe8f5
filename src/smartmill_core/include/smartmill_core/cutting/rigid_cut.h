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

/// Milling with a tool that does not vibrate, at steady speed and feed, from tables over a revolution: each
/// tooth's chips by ChipRule (runout, uneven pitch), their elementary forces integrated over the immersion
/// angle once; the force of an edge is the difference of the integral between its ends in the arc
/// (eq. 3.13..3.15 with any chip).
class RigidCut {
 public:
  /// @param radius_offset [m] of each tooth (runout), empty: none. @throws Error on an impossible tool.
  RigidCut(const ToolGeometry& tool, const CuttingLaw& law, std::vector<double> radius_offset = {});
  /// One arc, fed along x. @throws Error on an impossible engagement too.
  RigidCut(const ToolGeometry& tool, const CuttingLaw& law, const Engagement& engagement,
           std::vector<double> radius_offset = {});

  /// @param feed [m/rad] of the spindle, x and y. @throws Error on an impossible arc.
  void engage(const std::vector<ContactArc>& arcs, const std::array<double, 2>& feed);
  const std::vector<ContactArc>& arcs() const { return arcs_; }
  void setDepths(const std::vector<double>& depths);

  /// Chip and edge factors act at once; the rest of the law makes new tables.
  void setLaw(const CuttingLaw& law);

  /// Force on the tool when tooth 1 stands at an angle [rad].
  CuttingForce at(double angle);
  /// Chip of a tooth at an immersion angle [m], <= 0: no contact.
  double chip(int tooth, double phi) const;
  /// What the chip coefficients and what the edge coefficients give alone, the factors of the law left out.
  /// Without tables: quicker for less than some thousand angles, and to the digit where an edge force begins.
  std::array<CuttingForce, 2> partsAt(double angle) const;
  /// The mean of these over a revolution.
  std::array<CuttingForce, 2> meanParts() const;

 private:
  using Row = std::array<double, 8>;  // fx fy fz ft of the chip, the same of the edge
  using Sum = std::array<double, 4>;  // fx fy fz ft
  void shape();
  void tabulate();
  std::vector<Row> integrals(std::vector<ChipShape> shapes) const;
  void add(double weight, double thickness, const SineCosine& at, Row& row) const;
  void join();
  Sum joined(const Row& row) const;
  void addStraight(const EdgePart& part, Row& sum) const;
  void integrate(const std::vector<ChipShape>& shapes, double from, double to, double height, Row& sum) const;
  std::size_t tableOf(int tooth) const { return rule_.alike() ? 0 : static_cast<std::size_t>(tooth); }

  ToolGeometry tool_;
  ChipRule rule_;
  CuttingLaw law_;
  double lag_;
  std::vector<ContactArc> arcs_;
  std::array<double, 2> feed_{{0, 0}};          // [m/rad]
  std::vector<std::vector<ChipShape>> shapes_;  // what a tooth may meet; one entry when all teeth are alike
  std::vector<std::vector<Row>> tables_;  // the same: integrals from 0 to each node [N/m rad], when needed
  std::vector<std::vector<Sum>> joined_;  // with the factors of chip and edge, while these stand
  bool joined_now_ = false;
  int factor_changes_ = 0;
};

}  // namespace smartmill
