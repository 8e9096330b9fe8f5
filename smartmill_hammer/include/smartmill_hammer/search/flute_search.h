#pragma once

#include <string>
#include <vector>

namespace smartmill::hammer {

/// Angles and steps of a flute search.
struct FluteSearchOptions {
  double first_step = 0.0977;  ///< [rad] 5.6 deg, first step of the bracketing, > 0
  double max_step = 0.3927;    ///< [rad] 22.5 deg, longest step of the bracketing: one flute in a bracket
  double tolerance = 0.02618;  ///< [rad] 1.5 deg, width of the bracket at which the search ends
  double range_volt = 10.0;    ///< [V] the sensor outputs -range_volt when the tool is out of its range
  double noise_sigmas = 5.0;   ///< [1] standard deviations above which a difference is significant
  double least_rise = 0.005;   ///< [V] smallest significant difference
  /// [1] of the tolerance: distance from the top at which a measurement closes the bracket from both sides.
  double close_share = 0.45;
  double below_top_sigmas = 3.0;  ///< [1] deviations by which a measurement must be below the top to differ
  double range_share = 0.97;      ///< [1] of the range, from which a voltage counts as out of range
  bool golden_only = false;       ///< golden section alone from bracket to tolerance, as the thesis

  /// The steps of the thesis, shortened so that none spans more than a quarter of the smallest pitch [rad].
  static FluteSearchOptions forPitch(double least_pitch);
};

/// Finds the spindle angle at which a flute is nearest to the displacement sensor: bracketing (Dunwoody
/// eq. 4.7); then, until the bracket is narrower than the tolerance, measurements at the vertex of the
/// parabola through its three points and close to it, which narrow the bracket from both sides. Golden
/// section (eq. 4.2..4.6) replaces them wherever they do not halve the bracket in two moves (the edge of an
/// insert is no parabola). On a top so flat that measurements at the tolerance do not differ beyond their
/// noise, the search ends with the narrowest bracket that is significant. Resumable: turn the spindle to
/// nextAngle(), measure, addMeasurement(). Angles are unwrapped, from the start angle on. Flat intervals
/// (sensor out of range, floor of a gullet) are crossed; a difference counts only above the noise of both
/// averages.
class FluteSearch {
 public:
  enum class State { searching, found, no_flute };

  FluteSearch(double start_angle, const FluteSearchOptions& options);

  State state() const { return state_; }
  /// Why no flute was found; one line.
  const std::string& reason() const { return reason_; }

  /// [rad] angle to measure next, unwrapped; undefined after the end of the search.
  double nextAngle() const { return next_angle_; }

  /// @param angle [rad] reached, modulo a full turn @param volt [V] mean of the sensor there
  /// @param volt_std [V] standard deviation of that mean
  void addMeasurement(double angle, double volt, double volt_std);

  double angle() const { return angle_; }     ///< [rad] of the flute, unwrapped; when found
  double volt() const { return best_volt_; }  ///< [V] highest measurement
  struct Measurement {
    double angle, volt;  ///< [rad] unwrapped, [V]
  };
  const std::vector<Measurement>& measurements() const { return measurements_; }  ///< in order of time
  double bracketWidth() const;  ///< [rad] 0 before there is a bracket
  /// [1] probability, from the noise, that the top lies inside the bracket: that both ends are lower than its
  /// centre. Defined when a flute is found.
  double confidence() const { return confidence_; }

 private:
  struct Point {
    double angle, volt, volt_std;
  };
  bool isClearlyAbove(const Point& a, const Point& b) const;
  void extendBracket(const Point& p);
  void narrowBracket(const Point& p);
  void chooseNextAngle();
  struct Parabola {
    double curvature = 0.0;   // [V/rad2] negative: it has a maximum
    double vertex = 0.0;      // [rad] from the centre
    double resolvable = 0.0;  // [rad] from the vertex, where a voltage differs significantly
  };
  Parabola parabola() const;
  double stepTowardsTop(const Parabola& p) const;
  void finish();
  void fail(std::string reason);

  FluteSearchOptions options_;
  State state_ = State::searching;
  std::string reason_;
  double start_, next_angle_;
  bool bracketed_ = false;
  double direction_ = 0.0;  // of the bracketing steps; 0 before the second point
  double step_;
  std::vector<Point> walk_;
  Point left_{}, centre_{}, right_{};
  std::vector<double> widths_;  // [rad] of the bracket, after each measurement
  double angle_ = 0.0, best_volt_ = 0.0, confidence_ = 0.0;
  std::vector<Measurement> measurements_;
};

}  // namespace smartmill::hammer
