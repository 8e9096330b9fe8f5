#pragma once

#include <cstddef>
#include <vector>

#include "smartmill_program/nc/move.h"

namespace smartmill::program {

/// The moves of a program as one path. A place on it is a distance [m] along all moves from the first one; it
/// jumps where the program goes to a position that it does not state (G28, G53), between two moves.
class ProgramPath {
 public:
  /// A place near a point.
  struct Place {
    double distance = 0.0;   ///< [m] along the path
    double deviation = 0.0;  ///< [m] of the point from the path
    std::size_t move = 0;
  };

  explicit ProgramPath(std::vector<Move> moves);

  const std::vector<Move>& moves() const { return moves_; }
  double begin(std::size_t move) const { return begin_[move]; }  ///< [m] place
  double length() const { return begin_.back(); }                ///< [m]
  nc::PathSegment::Point at(double place) const;                 ///< [m] of the tool tip
  /// Places within a tolerance of a point, one for each passage of the path, in ascending order.
  /// @param point [m] of the tool tip @param from, to [m] part of the path that is searched
  /// @param tolerance [m]
  std::vector<Place> near(const nc::PathSegment::Point& point, double from, double to,
                          double tolerance) const;

  /// Whether a move or dwell with an N word reaches into a part of the path [m].
  bool hasSequence(int sequence, double from, double to) const;

 private:
  std::size_t firstMove(double from) const;

  std::vector<Move> moves_;
  std::vector<double> begin_;  // [m] of each move, and the end of the last
};

/// [m] between two points
double distanceBetween(const nc::PathSegment::Point& a, const nc::PathSegment::Point& b);

/// [m] Distance along a path to the place nearest to a point; of several the first.
/// @param from, to [m] part of the path that is searched
double nearestOn(const nc::PathSegment& path, const nc::PathSegment::Point& point, double from, double to);

}  // namespace smartmill::program
