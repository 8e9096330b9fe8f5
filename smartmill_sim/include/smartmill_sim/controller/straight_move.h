#pragma once

#include <array>

namespace smartmill::sim {

/// A point's motion along a straight line with trapezoidal speed: from a start speed to the feed, to rest
/// exactly at the target. Everything is closed form in the time since its start.
class StraightMove {
 public:
  /// At rest at a point, over at once.
  explicit StraightMove(const std::array<double, 3>& point) : start_(point), target_(point) {}
  /// Rest to rest. @param target [m]. @param feed [m/s] > 0. @param acceleration [m/s2] > 0.
  StraightMove(const std::array<double, 3>& start, const std::array<double, 3>& target, double feed,
               double acceleration);
  /// Brakes to rest from a velocity [m/s].
  static StraightMove brake(const std::array<double, 3>& start, const std::array<double, 3>& velocity,
                            double acceleration);

  double duration() const { return ramp_up_ + steady_ + ramp_down_; }  ///< [s]
  const std::array<double, 3>& target() const { return target_; }      ///< [m]
  /// @param time [s] since the start; the target at duration() and later.
  std::array<double, 3> position(double time) const;
  double speed(double time) const;                    ///< [m/s] along the line
  std::array<double, 3> velocity(double time) const;  ///< [m/s]

 private:
  std::array<double, 3> start_{{0, 0, 0}}, target_{{0, 0, 0}}, direction_{{0, 0, 0}};
  double length_ = 0.0;                                    // [m]
  double acceleration_ = 0.0;                              // [m/s2]
  double peak_ = 0.0;                                      // [m/s]
  double ramp_up_ = 0.0, steady_ = 0.0, ramp_down_ = 0.0;  // [s]
};

}  // namespace smartmill::sim
