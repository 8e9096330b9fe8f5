#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/cutting/tool.h"
#include "smartmill_sim/twin/cutting_process.h"

namespace smartmill::sim {

/// Milling with a tool that does not vibrate, at steady speed and feed: what CuttingProcess gives then, from
/// tables over a revolution. Each tooth's chip is its least distance to the surfaces that the teeth before it
/// left (runout, uneven pitch); elementary forces are integrated over the immersion angle once, and the force
/// of an edge is the difference of the integral between its ends in the arc (eq. 3.13..3.15 with any chip).
class RigidCut {
 public:
  /// @param radius_offset [m] of each tooth (runout), empty: none. @throws Error on an impossible tool.
  RigidCut(const ToolGeometry& tool, const CuttingLaw& law, std::vector<double> radius_offset = {});

  /// @throws Error on an arc outside 0..2 pi or without height.
  void engage(const std::vector<ContactArc>& arcs, const ToolMotion& now);
  const std::vector<ContactArc>& arcs() const { return arcs_; }
  void setDepths(const std::vector<double>& depths);

  /// Chip and edge factors act at once; the rest of the law makes new tables.
  void setLaw(const CuttingLaw& law);

  /// Force on the tool when tooth 1 stands at an angle [rad].
  CuttingForce at(double angle);

  /// Chip of a tooth at an immersion angle [m], <= 0: no contact.
  double chip(int tooth, double angle) const;

 private:
  using Row = std::array<double, 8>;  // fx fy fz ft of the chip, the same of the edge
  Row elementary(double chip, double sine, double cosine) const;
  void tabulate();
  double chip(std::size_t tooth, double sine, double cosine) const;
  using Sum = std::array<double, 4>;  // fx fy fz ft
  void join();
  void add(std::size_t table, double from, double to, Sum& sum) const;

  ToolGeometry tool_;
  CuttingLaw law_;
  std::vector<double> offset_, tooth_angle_;
  double lag_;
  std::vector<ContactArc> arcs_;
  std::array<double, 2> feed_{{0, 0}};       // [m/rad]
  std::vector<std::array<double, 2>> gaps_;  // of a tooth to each before it: [m] offset, [rad] ahead
  // Integrals from 0 to each node [N/m rad]; one table when all teeth are alike.
  std::vector<std::vector<Row>> tables_;
  std::vector<std::vector<Sum>> joined_;  // with the factors of chip and edge, while these stand
  bool joined_now_ = false;
  int factor_changes_ = 0;
};

}  // namespace smartmill::sim
