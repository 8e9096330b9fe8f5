#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_program/nc/move.h"

namespace smartmill::program {

/// Cutter radius compensation (G40, G41, G42) in the plane XY: replaces the programmed path by that of the
/// tool axis, offset by a radius. Inside corners end at the intersection of the offset paths, outside corners
/// are arcs about the programmed corner. The start-up move ends, and the cancelling move begins, on the
/// perpendicular of the programmed path at its first and last point. Moves along Z and dwells are executed at
/// the corner.
class CutterCompensation {
 public:
  enum class Side { left, right };  ///< G41, G42

  explicit CutterCompensation(std::vector<Move>& moves) : moves_(moves) {}

  /// Whether a motion is or will be offset.
  bool active() const { return phase_ == Phase::starting || phase_ == Phase::on; }
  /// The next line in the plane is the start-up move. @param radius [m] >= 0. @throws Error before the
  /// cancelling move of an earlier compensation
  void start(Side side, double radius);
  /// The next line in the plane is the cancelling move. Ends an element that waits for the next corner.
  void cancel();
  /// Takes a programmed motion or a dwell. @throws Error on an arc as start-up or cancelling move and on
  /// interference, naming the line
  void add(const Move& move);
  /// The position in the plane is no longer that of the program (G28, G53).
  void forget();

 private:
  using Vector = std::array<double, 2>;
  enum class Phase { off, starting, on, cancelling };
  struct Element {
    Move programmed;
    bool start_up = false;
    Vector from{};  // [m] of the tool axis
  };

  void corner(const Move& next);
  void emit(const Move& move, const nc::PathSegment& path);
  void emitElement(const Vector& to);
  void emitHere(const Move& move);
  void emitWaiting();
  nc::PathSegment offset(const Move& move) const;

  std::vector<Move>& moves_;
  Phase phase_ = Phase::off;
  double side_ = 1.0, radius_ = 0.0;  // +1 left; [m]
  std::optional<Element> element_;    // whose end depends on the next one
  std::vector<Move> waiting_;         // moves along Z and dwells behind it
  Vector at_{};                       // [m] tool axis
};

}  // namespace smartmill::program
