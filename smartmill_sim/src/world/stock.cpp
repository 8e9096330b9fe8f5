#include "smartmill_sim/world/stock.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/math/angle.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

using units::TWO_PI;

constexpr int SCAN_STEPS = 360;  // scanned angles of the front half; finer details of the stock are ignored
constexpr double LEAST_ARC = 1e-6;    // [rad]
constexpr double LEAST_DEPTH = 1e-7;  // [m] position increment of a controller
constexpr double LEAST_SPEED = 1e-7;  // [m/s]
constexpr double ON_WALL = 1e-9;      // [m] a point closer to a slot's wall is on the wall: no material
constexpr double SAME_DIRECTION = 1.0 - 1e-9;  // [1] cosine
constexpr double OFF_LINE = 1e-9;              // [m]

double distanceToLine(double x, double y, const std::array<double, 2>& from,
                      const std::array<double, 2>& to) {
  const double dx = to[0] - from[0], dy = to[1] - from[1], length2 = dx * dx + dy * dy;
  const double share =
      length2 > 0.0 ? std::clamp(((x - from[0]) * dx + (y - from[1]) * dy) / length2, 0.0, 1.0) : 0.0;
  return std::hypot(x - from[0] - share * dx, y - from[1] - share * dy);
}

}  // namespace

Stock::Stock(const Workpiece& workpiece, double radius) : box_(workpiece), radius_(radius) {
}

/// Height [m] of the material above z at a point after the first `slots` slots; 0: none.
double Stock::depthAt(double x, double y, double z, std::size_t slots) const {
  if (x < box_.low[0] || x > box_.high[0] || y < box_.low[1] || y > box_.high[1]) return 0.0;
  double top = box_.high[2];
  for (std::size_t k = 0; k < slots; ++k) {
    const Slot& slot = slots_[k];
    if (slot.bottom < top && distanceToLine(x, y, slot.from, slot.to) <= radius_ + ON_WALL) top = slot.bottom;
  }
  return top - z > LEAST_DEPTH ? top - z : 0.0;
}

std::vector<ContactArc> Stock::contact(const std::array<double, 3>& position,
                                       const std::array<double, 3>& velocity) const {
  std::vector<ContactArc> arcs;
  if (std::hypot(velocity[0], velocity[1]) < LEAST_SPEED || position[2] >= box_.high[2]) return arcs;
  // The slot being cut by this motion is excluded: it ends at the front of the tool.
  const std::size_t slots = slots_.size() - (continuesSlot(velocity) ? 1 : 0);
  const double heading = std::atan2(velocity[0], velocity[1]), first = heading - 0.5 * units::PI;
  const auto depth = [&](double offset) {
    const double angle = first + offset;
    return depthAt(position[0] + radius_ * std::sin(angle), position[1] + radius_ * std::cos(angle),
                   position[2], slots);
  };
  const auto add = [&](double from, double to, double height) {
    if (height <= 0.0 || to - from < LEAST_ARC) return;
    const double entry = wrapped(first + from), exit = entry + (to - from);
    if (exit <= TWO_PI + LEAST_ARC) {
      arcs.push_back({entry, std::min(exit, TWO_PI), height});
      return;
    }
    if (TWO_PI - entry >= LEAST_ARC) arcs.push_back({entry, TWO_PI, height});
    if (exit - TWO_PI >= LEAST_ARC) arcs.push_back({0.0, exit - TWO_PI, height});
  };
  double begin = 0.0, height = depth(0.0), last = 0.0;
  for (int k = 1; k <= SCAN_STEPS; ++k) {
    const double here = units::PI * k / SCAN_STEPS, now = depth(here);
    if (now != height) {
      double low = last, high = here;
      while (high - low > 1e-10) {
        const double middle = 0.5 * (low + high);
        (depth(middle) == height ? low : high) = middle;
      }
      add(begin, low, height);
      begin = high;
      height = now;
    }
    last = here;
  }
  add(begin, units::PI, height);
  return arcs;
}

bool Stock::hasMaterialAbove(const std::array<double, 3>& position) const {
  if (position[2] >= box_.high[2]) return false;
  for (const double share : {0.0, 0.5, 0.999}) {
    for (int k = 0; k < 16; ++k) {
      const double a = TWO_PI * k / 16, r = share * radius_;
      if (depthAt(position[0] + r * std::sin(a), position[1] + r * std::cos(a), position[2], slots_.size()) >
          0.0)
        return true;
    }
  }
  return false;
}

/// Whether a motion continues the open slot.
bool Stock::continuesSlot(const std::array<double, 3>& velocity) const {
  if (!slot_open_) return false;
  const Slot& slot = slots_.back();
  const double lx = slot.to[0] - slot.from[0], ly = slot.to[1] - slot.from[1], length = std::hypot(lx, ly);
  if (length == 0.0) return true;
  return velocity[0] * lx + velocity[1] * ly >=
         SAME_DIRECTION * length * std::hypot(velocity[0], velocity[1]);
}

bool Stock::continuesLine(const std::array<double, 3>& position) const {
  const Slot& slot = slots_.back();
  if (position[2] != slot.bottom) return false;
  const double dx = position[0] - slot.from[0], dy = position[1] - slot.from[1];
  const double lx = slot.to[0] - slot.from[0], ly = slot.to[1] - slot.from[1];
  const double length = std::hypot(lx, ly);
  if (length == 0.0) return true;
  const double along = (dx * lx + dy * ly) / length, lateral = (dx * ly - dy * lx) / length;
  return std::abs(lateral) <= OFF_LINE && along >= length;
}

void Stock::cutTo(const std::array<double, 3>& position) {
  const std::array<double, 2> here{{position[0], position[1]}};
  if (position[2] >= box_.high[2]) {
    slot_open_ = false;
  } else if (slot_open_ && continuesLine(position)) {
    slots_.back().to = here;
  } else {
    const std::array<double, 2> from =
        slot_open_ && slots_.back().bottom == position[2] ? slots_.back().to : here;
    slots_.push_back({from, here, position[2]});
    slot_open_ = true;
  }
}

}  // namespace smartmill::sim
