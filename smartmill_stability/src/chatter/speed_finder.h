#pragma once

#include <cstddef>
#include <vector>

namespace smartmill::stability {

/// Finds the spindle speed of a recording from the lines of its spectrum. The logarithm of each line's power
/// over the noise floor, limited, is its level: many lines count, not one strong one, which may be chatter.
/// For a speed the mean level of the lines at the spindle harmonics, and at whole revolutions from the
/// strongest line between them (chatter modulated by the teeth), is compared with that of all lines: half of
/// a speed has twice as many lines with the same sum, twice the speed half of the sum, and both deviate less
/// from chance.
class SpeedFinder {
 public:
  /// @param power [line] mean square of each line of a spectrum @param step [Hz] between lines
  /// @param lowest [Hz] lines below count nowhere @param teeth of the tool
  SpeedFinder(const std::vector<double>& power, double step, double lowest, int teeth);

  /// [1] Deviation from chance, in standard deviations of the mean of as many lines drawn at random: that of
  /// three tooth passing harmonics and twice that of all spindle harmonics below. @param speed [rad/s]
  double agreement(double speed) const;
  /// [rad/s] Speed from low to high with the largest agreement, from the frequencies of its harmonics.
  double best(double low, double high) const;
  /// [rad/s] Speed of a spindle of which nothing is known: the fastest one without strong lines at half or a
  /// third of it.
  double anywhere() const;
  /// Whether the tooth passing harmonics have more power than the other spindle harmonics: an idle spindle
  /// has all of them. With one tooth, whether there are any.
  bool teethDominate(double speed) const;
  double lowestSpeed() const;   ///< [rad/s] with resolved harmonics
  double highestSpeed() const;  ///< [rad/s] with three tooth passing harmonics in the spectrum

 private:
  double levelAt(double frequency) const;  // [1]; NaN outside the band
  double strongestBetween(double frequency) const;
  double refined(double speed) const;
  double between(double frequency, int factor) const;

  double step_, lowest_;
  int teeth_;
  std::vector<double> power_, floor_;  // [line]
  std::vector<double> level_;          // [quarter of a line] of the peak there; 0 without one
  std::vector<double> strong_;         // [Hz] lines far above the floor, strongest first
  double mean_ = 0.0, deviation_ = 1.0;
};

}  // namespace smartmill::stability
