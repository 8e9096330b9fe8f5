#pragma once

#include <string>
#include <vector>

namespace smartmill {
namespace hammer {

/// Pitch angles and steps of a flute search; angles in [rad].
struct FluteSearchOptions {
  double first_step = 0.0977;  ///< [rad] 5.6 deg, first step of the bracketing, > 0
  double max_step = 0.3927;  ///< [rad] 22.5 deg, longest step of the bracketing; keeps one flute in a bracket
  double tolerance = 0.02618;  ///< [rad] 1.5 deg, the bracket at which the search ends
  double range_volt = 10.0;    ///< [V] the sensor reads -range_volt when the tool is out of its range
  double noise_sigmas = 5.0;   ///< [1] a rise or fall counts above this many standard deviations
  double least_rise = 0.005;   ///< [V] and above this
  bool golden_only = false;    ///< the thesis's way from bracket to tolerance: golden section alone

  /// The thesis's steps, shortened so that no step spans more than a quarter of the least pitch [rad].
  static FluteSearchOptions forPitch(double least_pitch);
};

/// Finds the spindle angle at which a flute is nearest to the displacement sensor: bracketing (Dunwoody
/// eq. 4.7), then, until the bracket is below the tolerance, the vertex of the parabola through its three
/// points and readings close beside it that shut the bracket, golden section (eq. 4.2..4.6) wherever that
/// does not halve the bracket in two moves (an insert's edge is no parabola). On a top so flat that readings
/// at the tolerance do not differ beyond their noise it ends with the wider bracket that they tell.
/// Resumable: ask next(), turn the spindle there, measure, give(). Angles run on without wrapping, from the
/// start angle. Flat stretches (sensor out of range, floor of a gullet) are walked over; a difference counts
/// only above the noise of the two averages.
class FluteSearch {
 public:
  enum class State { searching, found, no_flute };

  FluteSearch(double start_angle, const FluteSearchOptions& options);

  State state() const { return state_; }
  /// Why there is no flute; one line.
  const std::string& reason() const { return reason_; }

  /// [rad] angle to measure next, unwrapped; meaningless once the search has ended.
  double next() const { return next_; }

  /// @param angle [rad] reached; any full turn @param volt [V] mean of the sensor there
  /// @param volt_std [V] standard deviation of that mean
  void give(double angle, double volt, double volt_std);

  double angle() const { return angle_; }     ///< [rad] of the flute, unwrapped; when found
  double volt() const { return best_volt_; }  ///< [V] best reading
  int measurements() const { return static_cast<int>(readings_.size()); }
  struct Reading {
    double angle, volt;  ///< [rad] unwrapped, [V]
  };
  const std::vector<Reading>& readings() const { return readings_; }  ///< in their order
  double bracketWidth() const;  ///< [rad] of the present bracket; 0 while bracketing
  /// [1] probability, by the readings' noise, that the top lies inside the bracket: both ends read less than
  /// its best place. When found.
  double sure() const { return sure_; }

 private:
  struct Point {
    double angle, volt, volt_std;
  };
  bool above(const Point& a, const Point& b) const;
  void bracket(const Point& p);
  void section(const Point& p);
  void askSection();
  struct Parabola {
    double curvature = 0.0;  // [V/rad2] below 0: it has a top
    double vertex = 0.0;     // [rad] from the centre
    double told = 0.0;       // [rad] beside the vertex a reading is told from the top's
  };
  Parabola parabola() const;
  double closer(const Parabola& p) const;
  void finish();
  void fail(std::string reason);

  FluteSearchOptions options_;
  State state_ = State::searching;
  std::string reason_;
  double start_, next_;
  bool bracketed_ = false;
  double direction_ = 0.0;  // of the walk: 0 until the first two points are known
  double step_;
  std::vector<Point> walk_;
  Point left_{}, centre_{}, right_{};
  std::vector<double> widths_;  // of the bracket, after each reading
  double angle_ = 0.0, best_volt_ = 0.0, sure_ = 0.0;
  std::vector<Reading> readings_;
};

/// [rad] angle brought to within half a turn of a reference by whole turns.
double nearAngle(double angle, double reference);

}  // namespace hammer
}  // namespace smartmill
