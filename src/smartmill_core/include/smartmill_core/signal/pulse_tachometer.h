#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill {

/// Channel [V] of a tachometer in its sample blocks, and column of a campaign's records.
constexpr const char* TACHOMETER_CHANNEL = "tachometer";

/// A tachometer that gives one or more pulses per revolution.
struct PulseTachometerParameters {
  int pulses_per_revolution = 1;
  double threshold = 2.5;   ///< half of the 5 V of a digital output
  double hysteresis = 1.0;  ///< far above the noise of such an output, far below its step
  bool falling = false;
  double angle = 0.0;
  /// A spindle of 1 s run-up to 6000 rpm changes its period by less than this from the third pulse on; a
  /// missing pulse changes it by 1, a double one by more than 0.5.
  double period_change = 0.25;
  double longest_period = 0.5;  ///< 120 rpm with one pulse per revolution
  double longest_window = 0.5;  ///< as long as filters take the speed for constant

  void declare(ParameterTable& table) {
    table.number("pulses_per_revolution", pulses_per_revolution, "1", Range::closed(1, 10000),
                 "pulses per revolution; with more than one the angle is only determined up to a pitch of "
                 "the pulses");
    table.number("threshold", threshold, "V", Range{}, "voltage at which a pulse begins");
    table.number("hysteresis", hysteresis, "V", Range::notNegative(),
                 "voltage by which the signal must pass back beyond the threshold before the next pulse");
    table.flag("falling", falling, "true: a pulse begins where the signal falls below the threshold");
    table.number("angle", angle, "rad", Range{}, "angle of tooth 1 when a pulse begins, clockwise from +y");
    table.number("period_change", period_change, "1", Range::open(0.0, 0.5),
                 "largest relative change of the period from one pulse to the next; beyond it a pulse is "
                 "missing, double or irregular");
    table.number("longest_period", longest_period, "s", Range::positive(),
                 "time without a pulse after which the spindle counts as at rest");
    table.number("longest_window", longest_window, "s", Range::positive(),
                 "longest time over which the speed is estimated; shorter where it changes");
  }
  /// @throws Error naming key and value.
  void validate() const;
};

/// Angle and speed of the spindle at a pulse, or at rest.
struct PulseReading {
  SpindleAngle angle;      ///< angle NaN at rest: between two pulses it is not determined
  double angle_std = 0.0;  ///< [rad] NaN at rest
  double speed_std = 0.0;  ///< [rad/s]
};

/// Finds the pulses of a sampled channel: crossings of the threshold, interpolated between two samples, with
/// hysteresis.
class PulseDetector {
 public:
  explicit PulseDetector(const PulseTachometerParameters& parameters) : parameters_(parameters) {}

  /// @param time [s] of the sample @param value [V] of the sample; not finite: the pulses next to it are not
  /// seen @return [s] time of a pulse
  std::optional<double> push(double time, double value);
  /// The next sample does not follow the last one.
  void interrupt() { last_time_.reset(); }

 private:
  PulseTachometerParameters parameters_;
  std::optional<double> last_time_;  // [s]
  double last_ = 0.0;                // [V] positive in the direction of a pulse, 0 at the threshold
  bool ready_ = false;               // was beyond the hysteresis since the last pulse
};

/// Turns pulses into angle and speed of the spindle (Bachrathy and Stepan section 2.3: one optical pulse per
/// revolution, linear angle between two pulses).
///
/// The angles of the latest pulses are fitted over their times: a line, or a parabola where its curvature is
/// significant; while the speed changes otherwise, a parabola over a third of the pulses whose residuals
/// agree with the standard deviation of a pulse's time. Where not even five agree, the last three give the
/// reading, and the change that is extrapolated counts as standard deviation. A variation of the speed within
/// one period is not observable.
///
/// Readings are given only while the pulses are regular: after three alike periods, and not for a pulse that
/// comes too early (double) or at a time that no number of missing pulses explains. Two such pulses in
/// succession, or one in each of three periods, start anew. Time is an argument; a backward jump starts anew.
class PulseTachometer {
 public:
  enum class State {
    waiting,  ///< too few pulses so far
    turning,
    at_rest,
    no_pulses  ///< although the controller reports a turning spindle
  };
  struct Counts {
    std::size_t pulses = 0, missing = 0, doubled = 0, irregular = 0, gaps = 0, not_finite = 0;
  };

  /// @throws Error on an invalid parameter.
  explicit PulseTachometer(const PulseTachometerParameters& parameters);

  /// A block of the channel `tachometer` [V]. @return readings in time order; at rest one at the end of the
  /// block. @throws Error when the channel is missing or not in V.
  std::vector<PulseReading> push(const SampleBlock& block);
  /// A pulse with its own time stamp. @param time [s] @param time_std [s] > 0
  std::optional<PulseReading> push(double time, double time_std);
  /// No pulse until a time [s]. @return the reading at rest
  std::optional<PulseReading> waitUntil(double time);
  /// Speed that the controller reports; it distinguishes a spindle at rest from a channel without pulses.
  /// @param speed [rad/s]; NaN: not known from now on
  void setControllerSpeed(double speed) { controller_speed_ = speed; }

  State state() const { return state_; }
  const Counts& counts() const { return counts_; }
  /// One line on the last fault of the channel; empty: none since the last call.
  std::string takeFault();
  /// Pulses of the fit of the last reading; 0: none.
  std::size_t window() const { return window_; }

 private:
  struct Pulse {
    long index;   // of the angle
    double time;  // [s]
  };
  struct Fit {
    double ahead, ahead_std;  // [pitches] of the spindle at the time of the latest pulse
    double rate, rate_std;    // [1/s] pulses at that time
    std::size_t pulses;
  };
  void restart();
  void fault(const std::string& text) { fault_ = text; }
  bool isRegular(double time);
  bool hasLocked() const;
  Fit fitOf(double time_std) const;
  PulseReading readingOf(const Fit& fit) const;

  PulseTachometerParameters parameters_;
  PulseDetector detector_;
  std::deque<Pulse> pulses_;
  std::vector<double> refused_;  // [s] pulses in succession that were not regular
  std::size_t alternating_ = 0;  // regular pulses in succession with a refused one before each
  bool locked_ = false;
  double period_ = 0.0;           // [s] of the next pulse
  std::optional<double> silent_;  // [s] time of the last pulse, or of the first sample
  std::optional<std::uint64_t> next_index_;
  double controller_speed_ = NOT_A_NUMBER;  // [rad/s]
  State state_ = State::waiting;
  Counts counts_;
  std::string fault_;
  std::size_t window_ = 0;
};

/// Spindle angle [rad] 0..2 pi at the times of a record, linear between two pulses; before the first and
/// after the last pulse with the next period. Of missing pulses the neighbours are used.
/// @param time [s] of each sample, even @param values [V] @param where begins the message
/// @param notes receives one line on missing and double pulses
/// @throws Error when there are fewer than three pulses, or pulses that are not regular.
std::vector<double> angleOfPulses(const std::vector<double>& time, const std::vector<double>& values,
                                  const PulseTachometerParameters& parameters, const std::string& where,
                                  std::vector<std::string>* notes);

}  // namespace smartmill
