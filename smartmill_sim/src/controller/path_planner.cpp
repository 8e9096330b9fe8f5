#include "controller/path_planner.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

using Point = AxesMotion::Point;

constexpr double INCH = 25.4 * units::MM;
constexpr double TRAVEL_TOLERANCE = 1e-9;  // [m] rounding of decimal input

std::array<double, 2> centreOf(const NcBlock& block, const NcModal& modal, const Point& from, const Point& to,
                               double tolerance) {
  if (block.radius) {
    // Two circles pass through start and end; a positive R selects the shorter arc.
    const double r = *block.radius * modal.unit();
    const double dx = to[0] - from[0], dy = to[1] - from[1], chord = std::hypot(dx, dy);
    const double square = r * r - 0.25 * chord * chord;
    if (chord == 0.0 || square < -tolerance * std::abs(r)) throw NcAlarm(PS_ARC, "OVER TOLERANCE OF RADIUS");
    const double side = (modal.motion == 2) == (r > 0.0) ? 1.0 : -1.0;
    const double height = side * std::sqrt(std::max(0.0, square)) / chord;
    return {from[0] + 0.5 * dx + height * dy, from[1] + 0.5 * dy - height * dx};
  }
  if (!block.centre[0] && !block.centre[1]) throw NcAlarm(PS_ARC, "NO RADIUS COMMANDED");
  const std::array<double, 2> centre{from[0] + block.centre[0].value_or(0.0) * modal.unit(),
                                     from[1] + block.centre[1].value_or(0.0) * modal.unit()};
  const double begin = std::hypot(from[0] - centre[0], from[1] - centre[1]);
  const double end = std::hypot(to[0] - centre[0], to[1] - centre[1]);
  if (begin == 0.0 || std::abs(begin - end) > tolerance) throw NcAlarm(PS_ARC, "OVER TOLERANCE OF RADIUS");
  return centre;
}

void checkTravel(const PathMove& move, const MachineAxes& axes) {
  const auto extent = move.extent();
  for (std::size_t i = 0; i < 3; ++i) {
    const double low = i < 2 ? extent[i][0] : move.target()[2];
    const double high = i < 2 ? extent[i][1] : move.target()[2];
    const bool plus = high > axes.travel[i][1] + TRAVEL_TOLERANCE;
    if (!plus && !(low < axes.travel[i][0] - TRAVEL_TOLERANCE)) continue;
    throw NcAlarm(plus ? OT_PLUS : OT_MINUS, ALARM_OT,
                  std::string(plus ? "(+)" : "(-)") + " OVERTRAVEL " + "XYZ"[i], static_cast<int>(i) + 1);
  }
}

}  // namespace

void NcModal::update(const NcBlock& block) {
  relative = block.relative.value_or(relative);
  inch = block.inch.value_or(inch);
  per_turn = block.per_turn.value_or(per_turn);
  work = static_cast<std::size_t>(block.work.value_or(static_cast<int>(work)));
  motion = block.motion.value_or(motion);
  feed = block.feed.value_or(feed);
}

double NcModal::unit() const {
  return inch ? INCH : units::MM;
}

AxesMotion::Path pathOf(const NcBlock& block, const NcModal& modal, const Point& from, const Point& offset,
                        const ControllerOptions& options) {
  Point to = from, home = from;
  for (std::size_t i = 0; i < 3; ++i) {
    if (!block.axis[i]) continue;
    const double zero = block.machine ? 0.0 : modal.relative ? from[i] : offset[i];
    to[i] = *block.axis[i] * modal.unit() + zero;
    home[i] = options.axes.home[i];
  }
  AxesMotion::Path path;
  if (block.reference) {
    // Through the programmed point to the reference position of the named axes.
    path = {{PathMove::line(from, to), true}, {PathMove::line(to, home), true}};
  } else if (modal.motion >= 2 && !block.machine && !(block.radius && from == to)) {
    path = {
        {PathMove::arc(from, to, centreOf(block, modal, from, to, options.arc_tolerance), modal.motion == 2),
         false}};
  } else {
    // Machine coordinates are approached in rapid traverse in any motion mode; a radius arc that ends at its
    // start is no motion.
    path = {{PathMove::line(from, to), modal.motion == 0 || block.machine}};
  }
  for (const AxesMotion::Segment& segment : path) checkTravel(segment.move, options.axes);
  return path;
}

}  // namespace smartmill::sim
