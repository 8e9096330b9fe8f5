#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "smartmill_core/cutting/contact_arc.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::sim {

/// Stock on the table, cut by a flat cylindrical tool that moves in straight lines: a box without the slots
/// made so far. Positions are of the tool tip's centre in the machine frame. Below the box the stock is taken
/// to go on.
class Stock {
 public:
  /// @param radius [m] of the tool
  Stock(const Workpiece& workpiece, double radius);

  /// Where the teeth of a tool that moves in x and y meet material: the front half of the tool, as far as
  /// there is stock. Empty without motion in x and y. @param position [m] @param velocity [m/s]
  std::vector<ContactArc> contact(const std::array<double, 3>& position,
                                  const std::array<double, 3>& velocity) const;

  /// Whether material stands above the tip anywhere within the tool's circle.
  bool above(const std::array<double, 3>& position) const;

  /// The tool, cutting, has come here: what it passed over is gone once it turns off the line.
  void pass(const std::array<double, 3>& position);
  /// The tool meets nothing: what it cuts next begins where it is then.
  void leave() { open_ = false; }

 private:
  /// What the tool cleared along a straight line.
  struct Slot {
    std::array<double, 2> from, to;  // [m]
    double bottom;                   // [m] z of the tip
  };
  double depthAt(double x, double y, double z, std::size_t slots) const;
  bool along(const std::array<double, 3>& velocity) const;
  bool inLine(const std::array<double, 3>& position) const;

  Workpiece box_;
  double radius_;
  std::vector<Slot> slots_;
  bool open_ = false;  // the last slot is still being made
};

}  // namespace smartmill::sim
