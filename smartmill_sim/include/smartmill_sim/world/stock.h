#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "smartmill_core/cutting/contact_arc.h"
#include "smartmill_core/cutting/tool_profile.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::sim {

/// Stock on the table: a box minus the slots cut so far, each along a straight line, also a sloping one;
/// other paths are chords from call to call. Positions are those of the centre of the tool tip in the machine
/// frame. The stock is assumed to continue below the box.
class Stock {
 public:
  Stock(const Workpiece& workpiece, const ToolGeometry& tool);

  /// Another tool, out of contact.
  void changeTool(const ToolGeometry& tool);

  /// Contact of the teeth of a tool that moves in x and y: where the front half of the tool advances into
  /// stock. A curved or inclined edge has one band for each slice of its height. Empty without motion in x
  /// and y. @param position [m] @param velocity [m/s]
  std::vector<ContactArc> contact(const std::array<double, 3>& position,
                                  const std::array<double, 3>& velocity) const;

  /// Whether there is material above the flat part of the end.
  bool hasMaterialAbove(const std::array<double, 3>& position) const;

  /// The cutting tool has reached a position [m]: the stock along its path is removed, effective once it
  /// leaves the present line.
  void cutTo(const std::array<double, 3>& position);
  /// The tool is out of contact: the next slot begins at the next cutTo().
  void endSlot() { slot_open_ = false; }

 private:
  using Point = std::array<double, 3>;  // [m]
  /// Slot cut along a straight line.
  struct Slot {
    Point from, to;
    std::size_t tool;  // of profiles_
  };
  /// Range of the edge's height.
  struct Ring {
    double low, high;  // [m] above the tip
  };
  struct Circle;
  const ToolProfile& profile() const { return profiles_.back(); }
  double floorOf(const Slot& slot, double x, double y) const;
  double depthAt(double x, double y, double z, std::size_t slots) const;
  void addSide(const Circle& circle, std::vector<ContactArc>& arcs) const;
  void addRing(const Ring& ring, Circle circle, std::vector<ContactArc>& arcs) const;
  const std::vector<std::size_t>* slotsNear(double x, double y) const;
  void addToCells(const Point& from, const Point& to);
  bool continuesSlot(const std::array<double, 3>& velocity) const;
  bool continuesLine(const Point& position) const;

  Workpiece box_;
  std::vector<ToolProfile> profiles_;  // of all tools so far
  std::vector<Ring> rings_;            // of the curved or inclined part of the present tool's edge
  std::vector<Slot> slots_;
  /// Slots that may reach a square cell, in ascending order, row by row along y.
  std::vector<std::vector<std::size_t>> cells_;
  std::size_t columns_, rows_;
  bool slot_open_ = false;  // the last slot is still being cut
};

}  // namespace smartmill::sim
