#include "smartmill_sim/world/stock.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "smartmill_core/cutting/corner.h"
#include "smartmill_core/math/angle.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

using units::PI;
using units::TWO_PI;

constexpr int SCAN_STEPS = 360;  // scanned angles of the front half; finer details of the stock are ignored
/// Of a corner, twice the slices of its force: near the tip the contact changes faster than the edge.
constexpr int RINGS = 2 * CORNER_SLICES;
constexpr int RING_STEPS = 90;  // the same of each slice of a curved edge
constexpr int HEIGHT_BISECTIONS = 10;
constexpr double LEAST_ARC = 1e-6;    // [rad]
constexpr double LEAST_DEPTH = 1e-7;  // [m] position increment of a controller
/// [m] depths within it are one arc: a ramp leaves a floor of any number of heights
constexpr double SAME_DEPTH = 5e-5;
constexpr double LEAST_SPEED = 1e-7;  // [m/s]
constexpr double ON_WALL = 1e-9;      // [m] a point closer to a slot's wall is on the wall: no material
constexpr double SAME_DIRECTION = 1.0 - 1e-9;  // [1] cosine
constexpr double OFF_LINE = 1e-9;              // [m]

constexpr double CELL = 2e-3;  // [m]

bool isSameDepth(double a, double b) {
  return (a == 0.0) == (b == 0.0) && std::abs(a - b) < SAME_DEPTH;
}

std::size_t cellsOver(double length) {
  return static_cast<std::size_t>(std::max(1.0, std::ceil(length / CELL)));
}

/// Place of a point relative to a line in the plane.
struct OnLine {
  double length;          // [m] of the line
  double along, lateral;  // [m] from its start
};
template <class Point>
OnLine onLine(double x, double y, const Point& from, const Point& to) {
  const double dx = to[0] - from[0], dy = to[1] - from[1], length = std::hypot(dx, dy);
  if (length == 0.0) return {0.0, 0.0, std::hypot(x - from[0], y - from[1])};
  const double px = x - from[0], py = y - from[1];
  return {length, (px * dx + py * dy) / length, std::abs(px * dy - py * dx) / length};
}

double distanceToLine(const OnLine& at) {
  return std::hypot(at.along - std::clamp(at.along, 0.0, at.length), at.lateral);
}

/// Calls visit(entry, exit) for an interval of immersion angles, divided at +y. @param low [rad]
template <class Visit>
void forEachTurn(double low, double high, Visit&& visit) {
  if (high - low < LEAST_ARC) return;
  const double entry = wrapped(low), exit = entry + (high - low);
  if (exit <= TWO_PI + LEAST_ARC) {
    visit(entry, std::min(exit, TWO_PI));
    return;
  }
  if (TWO_PI - entry >= LEAST_ARC) visit(entry, TWO_PI);
  if (exit - TWO_PI >= LEAST_ARC) visit(0.0, exit - TWO_PI);
}

/// Bisects the change between two values. @param same whether a value is on the side of `low`
/// @return the two values on its sides
template <class Same>
std::pair<double, double> changeBetween(double low, double high, double resolution, Same&& same) {
  while (high - low > resolution) {
    const double middle = 0.5 * (low + high);
    (same(middle) ? low : high) = middle;
  }
  return {low, high};
}

}  // namespace

/// A circle of the tool in the stock, with the angles of its front half.
struct Stock::Circle {
  const Stock* stock;
  Point centre;       // [m]
  double radius;      // [m]
  double first;       // [rad] immersion angle at which the front half begins
  double rise;        // [1] of the feed over its horizontal part
  std::size_t slots;  // that count

  /// [rad] Angle from the beginning of the front half at which a surface of this slope [1] begins to advance;
  /// it ends as far before the end. A rising tool does not advance at its sides, a descending one does behind
  /// them too. pi/2: nowhere
  double begin(double slope) const {
    if (std::isinf(slope)) return 0.0;
    return slope > 0.0 ? std::asin(std::clamp(rise / slope, -1.0, 1.0)) : rise < 0.0 ? -0.5 * PI : 0.5 * PI;
  }
  /// [m] Material above the circle at an angle of the front half.
  double depth(double offset) const {
    const double angle = first + offset;
    return stock->depthAt(centre[0] + radius * std::sin(angle), centre[1] + radius * std::cos(angle),
                          centre[2], slots);
  }
};

Stock::Stock(const Workpiece& workpiece, const ToolGeometry& tool)
    : box_(workpiece),
      columns_(cellsOver(workpiece.high[0] - workpiece.low[0])),
      rows_(cellsOver(workpiece.high[1] - workpiece.low[1])) {
  cells_.resize(columns_ * rows_);
  changeTool(tool);
}

void Stock::changeTool(const ToolGeometry& tool) {
  const double height = box_.high[2] - box_.low[2];
  profiles_.emplace_back(tool, height);
  rings_.clear();
  if (!profile().flat())
    for (const EdgeSlice& slice : edgeSlices(tool, height, RINGS))
      if (slice.low < profile().top()) rings_.push_back({slice.low, std::min(slice.high, profile().top())});
  slot_open_ = false;
}

/// The slots near a point in the box; null outside.
const std::vector<std::size_t>* Stock::slotsNear(double x, double y) const {
  if (x < box_.low[0] || x > box_.high[0] || y < box_.low[1] || y > box_.high[1]) return nullptr;
  const auto column = static_cast<std::size_t>((x - box_.low[0]) / CELL),
             row = static_cast<std::size_t>((y - box_.low[1]) / CELL);
  return &cells_[std::min(row, rows_ - 1) * columns_ + std::min(column, columns_ - 1)];
}

/// Enters the last slot into the cells that its part between two points reaches.
void Stock::addToCells(const Point& from, const Point& to) {
  const std::size_t slot = slots_.size() - 1;
  const double reach = profile().radius() + CELL;
  const auto range = [&](std::size_t axis, std::size_t count) {
    const auto [low, high] = std::minmax(from[axis], to[axis]);
    const auto cell = [&](double coordinate) {
      return static_cast<std::size_t>(
          std::clamp((coordinate - box_.low[axis]) / CELL, 0.0, static_cast<double>(count)));
    };
    return std::pair<std::size_t, std::size_t>(cell(low - reach), std::min(count, cell(high + reach) + 1));
  };
  const auto [first_column, last_column] = range(0, columns_);
  const auto [first_row, last_row] = range(1, rows_);
  for (std::size_t i = first_column; i < last_column; ++i) {
    for (std::size_t j = first_row; j < last_row; ++j) {
      const double x = box_.low[0] + (static_cast<double>(i) + 0.5) * CELL,
                   y = box_.low[1] + (static_cast<double>(j) + 0.5) * CELL;
      if (distanceToLine(onLine(x, y, from, to)) > reach) continue;
      std::vector<std::size_t>& cell = cells_[j * columns_ + i];
      if (cell.empty() || cell.back() != slot) cell.push_back(slot);
    }
  }
}

/// [m] z of the floor of a slot at a point; infinite where it does not reach. On a slope the lowest height of
/// the tool over the path within reach, a convex function of the place.
double Stock::floorOf(const Slot& slot, double x, double y) const {
  constexpr int SECTIONS = 40;                    // golden: 5e-9 of the path within reach
  constexpr double GOLDEN = 0.61803398874989485;  // [1]
  const ToolProfile& tool = profiles_[slot.tool];
  const double infinite = std::numeric_limits<double>::infinity();
  const OnLine at = onLine(x, y, slot.from, slot.to);
  const double distance = distanceToLine(at), rise = slot.to[2] - slot.from[2];
  if (distance > tool.radius() + ON_WALL) return infinite;
  if (rise == 0.0) return slot.from[2] + tool.height(std::min(distance, tool.radius()));
  if (at.length == 0.0) return std::min(slot.from[2], slot.to[2]) + tool.height(distance);
  const double radius = tool.radius() + ON_WALL,
               half = std::sqrt(std::max(0.0, radius * radius - at.lateral * at.lateral));
  double low = std::clamp(at.along - half, 0.0, at.length),
         high = std::clamp(at.along + half, 0.0, at.length);
  const auto height = [&](double place) {
    return slot.from[2] + rise * place / at.length +
           tool.height(std::min(std::hypot(place - at.along, at.lateral), tool.radius()));
  };
  if (tool.flat()) return height(rise < 0.0 ? high : low);
  double a = high - GOLDEN * (high - low), b = low + GOLDEN * (high - low);
  double height_a = height(a), height_b = height(b);
  for (int k = 0; k < SECTIONS; ++k) {
    if (height_a < height_b) {
      high = b, b = a, height_b = height_a;
      height_a = height(a = high - GOLDEN * (high - low));
    } else {
      low = a, a = b, height_a = height_b;
      height_b = height(b = low + GOLDEN * (high - low));
    }
  }
  return std::min(height_a, height_b);
}

/// Height [m] of the material above z at a point after the first `slots` slots; 0: none.
double Stock::depthAt(double x, double y, double z, std::size_t slots) const {
  const std::vector<std::size_t>* near = slotsNear(x, y);
  if (!near) return 0.0;
  double top = box_.high[2];
  // The last slots first: most points are free at the level of the tool.
  for (auto k = near->rbegin(); k != near->rend() && top - z > LEAST_DEPTH; ++k) {
    const Slot& slot = slots_[*k];
    if (*k < slots && std::min(slot.from[2], slot.to[2]) < top) top = std::min(top, floorOf(slot, x, y));
  }
  return top - z > LEAST_DEPTH ? top - z : 0.0;
}

/// The cylinder from the circle up.
void Stock::addSide(const Circle& circle, std::vector<ContactArc>& arcs) const {
  const double bottom = profile().top();
  const auto add = [&](double from, double to, double height) {
    if (height <= 0.0) return;
    forEachTurn(circle.first + from, circle.first + to, [&](double entry, double exit) {
      arcs.push_back({entry, exit, bottom + height, bottom});
    });
  };
  double begin = 0.0, height = circle.depth(0.0), last = 0.0;
  for (int k = 1; k <= SCAN_STEPS; ++k) {
    const double here = PI * k / SCAN_STEPS, now = circle.depth(here);
    if (!isSameDepth(now, height)) {
      const auto [low, high] =
          changeBetween(last, here, 1e-10, [&](double at) { return isSameDepth(circle.depth(at), height); });
      add(begin, low, height);
      begin = high;
      height = now;
    }
    last = here;
  }
  add(begin, PI, height);
}

/// A slice of the curved or inclined part, from the lowest to the highest contact in it.
/// @param circle at the tip
void Stock::addRing(const Ring& ring, Circle circle, std::vector<ContactArc>& arcs) const {
  const double tip = circle.centre[2];
  const auto place = [&](double height) {
    circle.centre[2] = tip + height;
    circle.radius = profile().radiusAt(height);
  };
  const auto beginOf = [&](double height) {
    return circle.begin(profile().slope(profile().radiusAt(height)));
  };
  const auto touches = [&](double height) {
    place(height);
    const double begin = beginOf(height), range = PI - 2.0 * begin;
    for (int k = 0; k < RING_STEPS && range > 0.0; ++k)
      if (circle.depth(begin + range * (k + 0.5) / RING_STEPS) > 0.0) return true;
    return false;
  };
  double low = ring.low, high = ring.high;
  const bool below = touches(low), above = touches(high);
  if (!below && !above && !touches(0.5 * (low + high))) return;
  const double resolution = (high - low) / (1 << HEIGHT_BISECTIONS);
  if (below != above) {
    const double change =
        changeBetween(low, high, resolution, [&](double height) { return touches(height) == below; }).first;
    (below ? high : low) = change;
  }
  if (!(high - low > resolution)) return;
  place(0.5 * (low + high));
  const auto add = [&](double from, double to) {
    forEachTurn(circle.first + from, circle.first + to, [&](double entry, double exit) {
      arcs.push_back({entry, exit, high, low});
    });
  };
  const double first = beginOf(0.5 * (low + high)), end = PI - first;
  bool inside = circle.depth(first) > 0.0;
  double begin = first, last = first;
  for (int k = 1; k <= RING_STEPS && end > first; ++k) {
    const double here = first + (end - first) * k / RING_STEPS;
    if ((circle.depth(here) > 0.0) != inside) {
      const auto [before, after] =
          changeBetween(last, here, LEAST_ARC, [&](double at) { return (circle.depth(at) > 0.0) == inside; });
      if (inside) add(begin, before);
      begin = after;
      inside = !inside;
    }
    last = here;
  }
  if (inside) add(begin, end);
}

std::vector<ContactArc> Stock::contact(const std::array<double, 3>& position,
                                       const std::array<double, 3>& velocity) const {
  std::vector<ContactArc> arcs;
  const double feed = std::hypot(velocity[0], velocity[1]);
  if (feed < LEAST_SPEED || position[2] >= box_.high[2]) return arcs;
  // The slot being cut by this motion is excluded: it ends at the front of the tool.
  const std::size_t slots = slots_.size() - (continuesSlot(velocity) ? 1 : 0);
  const double heading = std::atan2(velocity[0], velocity[1]);
  Circle circle{this, position, 0.0, heading - 0.5 * PI, velocity[2] / feed, slots};
  for (const Ring& ring : rings_) {
    if (position[2] + ring.low >= box_.high[2]) return arcs;
    addRing(ring, circle, arcs);
  }
  circle.centre[2] += profile().top();
  circle.radius = profile().radius();
  if (circle.centre[2] < box_.high[2]) addSide(circle, arcs);
  return arcs;
}

bool Stock::hasMaterialAbove(const std::array<double, 3>& position) const {
  const double radius = profile().flatRadius();
  if (position[2] >= box_.high[2] || radius == 0.0) return false;
  for (const double share : {0.0, 0.5, 0.999}) {
    for (int k = 0; k < 16; ++k) {
      const double a = TWO_PI * k / 16, r = share * radius;
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
  double dot = 0.0, length2 = 0.0, speed2 = 0.0;
  for (std::size_t a = 0; a < 3; ++a) {
    const double step = slot.to[a] - slot.from[a];
    dot += velocity[a] * step;
    length2 += step * step;
    speed2 += velocity[a] * velocity[a];
  }
  return length2 == 0.0 || dot >= SAME_DIRECTION * std::sqrt(length2 * speed2);
}

bool Stock::continuesLine(const Point& position) const {
  const Slot& slot = slots_.back();
  Point line{}, step{};
  double length2 = 0.0, along = 0.0;
  for (std::size_t a = 0; a < 3; ++a) {
    line[a] = slot.to[a] - slot.from[a];
    step[a] = position[a] - slot.from[a];
    length2 += line[a] * line[a];
    along += line[a] * step[a];
  }
  if (length2 == 0.0) return true;
  double off2 = 0.0;
  for (std::size_t a = 0; a < 3; ++a) off2 += std::pow(step[a] - along / length2 * line[a], 2);
  return off2 <= OFF_LINE * OFF_LINE && along >= length2;
}

void Stock::cutTo(const std::array<double, 3>& position) {
  if (position[2] >= box_.high[2]) {
    slot_open_ = false;
  } else if (slot_open_ && continuesLine(position)) {
    addToCells(slots_.back().to, position);
    slots_.back().to = position;
  } else {
    slots_.push_back({slot_open_ ? slots_.back().to : position, position, profiles_.size() - 1});
    addToCells(slots_.back().from, position);
    slot_open_ = true;
  }
}

}  // namespace smartmill::sim
