#include "smartmill_program/live/program_path.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/math/angle.h"
#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

using nc::PathSegment;
using Point = PathSegment::Point;

}  // namespace

double distanceBetween(const Point& a, const Point& b) {
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

double nearestOn(const PathSegment& path, const Point& point, double from, double to) {
  if (!path.isArc()) {
    const Point direction = path.direction(0.0);
    double along = 0.0;
    for (std::size_t i = 0; i < 3; ++i) along += direction[i] * (point[i] - path.start()[i]);
    return std::clamp(along, from, to);
  }
  double best = from, least = distanceBetween(point, path.at(from));
  const auto consider = [&](double distance) {
    const double here = distanceBetween(point, path.at(distance));
    if (here < least) best = distance, least = here;
  };
  // At the angle of the point in each turn, or at an end.
  const auto [a, b, c] = nc::axesOf(path.plane());
  const double angle = std::atan2(point[b] - path.centre()[1], point[a] - path.centre()[0]);
  const double turned = (path.sweep() < 0.0 ? -1.0 : 1.0) * (angle - path.startAngle());
  const double per_angle = path.length() / std::abs(path.sweep());
  for (double along = wrapped(turned) * per_angle; along < to; along += units::TWO_PI * per_angle)
    if (along > from) consider(along);
  consider(to);
  return best;
}

ProgramPath::ProgramPath(std::vector<Move> moves) : moves_(std::move(moves)) {
  begin_.reserve(moves_.size() + 1);
  begin_.push_back(0.0);
  for (const Move& move : moves_) begin_.push_back(begin_.back() + move.path.length());
}

/// The first that ends at or after a place.
std::size_t ProgramPath::firstMove(double from) const {
  return static_cast<std::size_t>(std::lower_bound(begin_.begin() + 1, begin_.end(), from) - begin_.begin()) -
         1;
}

Point ProgramPath::at(double place) const {
  const std::size_t move = std::min(firstMove(place), moves_.size() - 1);
  return moves_[move].path.at(std::clamp(place - begin_[move], 0.0, moves_[move].path.length()));
}

bool ProgramPath::hasSequence(int sequence, double from, double to) const {
  for (std::size_t m = firstMove(from); m < moves_.size() && begin_[m] <= to; ++m)
    if (moves_[m].sequence == sequence) return true;
  return false;
}

std::vector<ProgramPath::Place> ProgramPath::near(const Point& point, double from, double to,
                                                  double tolerance) const {
  std::vector<Place> places;
  for (std::size_t m = firstMove(from); m < moves_.size() && begin_[m] <= to; ++m) {
    const PathSegment& path = moves_[m].path;
    // By rounding the part may begin behind the end of the first move.
    const double low = std::clamp(from - begin_[m], 0.0, path.length());
    const double high = std::min(path.length(), to - begin_[m]);
    if (low > high) continue;
    const double along = nearestOn(path, point, low, high);
    const double deviation = distanceBetween(point, path.at(along));
    if (deviation > tolerance) continue;
    const Place place{begin_[m] + along, deviation, m};
    // Moves that meet near the point are one passage.
    if (!places.empty() && place.distance - places.back().distance <= 2.0 * tolerance) {
      if (deviation < places.back().deviation) places.back() = place;
    } else {
      places.push_back(place);
    }
  }
  return places;
}

}  // namespace smartmill::program
