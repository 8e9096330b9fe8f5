#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "smartmill_core/cutting/contact_arc.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::sim {

/// Stock on the table, cut by a flat cylindrical tool that moves in straight lines: a box minus the slots cut
/// so far. Positions are those of the centre of the tool tip in the machine frame. The stock is assumed to
/// continue below the box.
class Stock {
 public:
  /// @param radius [m] of the tool
  Stock(const Workpiece& workpiece, double radius);

  /// Contact of the teeth of a tool that moves in x and y: the front half of the tool, where there is stock.
  /// Empty without motion in x and y. @param position [m] @param velocity [m/s]
  std::vector<ContactArc> contact(const std::array<double, 3>& position,
                                  const std::array<double, 3>& velocity) const;

  /// Whether there is material above the tip within the tool's circle.
  bool hasMaterialAbove(const std::array<double, 3>& position) const;

  /// The cutting tool has reached a position [m]: the stock along its path is removed, effective once it
  /// leaves the present line.
  void cutTo(const std::array<double, 3>& position);
  /// The tool is out of contact: the next slot begins at the next cutTo().
  void endSlot() { slot_open_ = false; }

 private:
  /// Slot cut along a straight line.
  struct Slot {
    std::array<double, 2> from, to;  // [m]
    double bottom;                   // [m] z of the tip
  };
  double depthAt(double x, double y, double z, std::size_t slots) const;
  bool continuesSlot(const std::array<double, 3>& velocity) const;
  bool continuesLine(const std::array<double, 3>& position) const;

  Workpiece box_;
  double radius_;
  std::vector<Slot> slots_;
  bool slot_open_ = false;  // the last slot is still being cut
};

}  // namespace smartmill::sim
