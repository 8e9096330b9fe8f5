#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>

#include "smartmill_core/signal/streams.h"

namespace smartmill {

struct OrderTrackerParameters {
  double search = 0.03;       ///< [1] of the controller's speed, to either side: slip of an induction motor
  double window = 0.25;       ///< [s] evaluated at a time; longer where it has fewer than 16 tooth periods
  double least_share = 0.05;  ///< [1] of the squares of the signal about its mean in the tooth-passing order
  double largest_scatter = 0.5;  ///< [rad] of the phases of the pieces of a window about a line
};

/// Speed and angle of the spindle from the tooth-passing order of a cutting force.
///
/// The signal of a window is demodulated at the tooth-passing frequency in pieces; a line through their
/// unwrapped phases gives frequency and phase (S. Tretter: Estimating the frequency of a noisy sinusoid by
/// linear regression, IEEE Trans. Inform. Theory 31, 1985), their scatter the standard deviations. The angle
/// follows up to a constant, which stays as long as the tracker stays locked; it changes with the engagement
/// of the cut. The constant is that of the last better source (AngleSelector).
class OrderTracker {
 public:
  struct Reading {
    SpindleAngle angle;
    double angle_std, speed_std;  ///< [rad], [rad/s]
  };

  explicit OrderTracker(const OrderTrackerParameters& parameters = {}) : parameters_(parameters) {}

  /// What the controller and the cut state. @param speed [rad/s]; 0 or NaN: not known @param teeth [1]; 0:
  /// not known. Even pitch.
  void setCut(double speed, std::size_t teeth);
  /// @param channel of the force in the block @return a reading at the end of the block
  std::optional<Reading> push(const SampleBlock& block, std::size_t channel);

  bool locked() const { return locked_; }
  std::size_t locks() const { return locks_; }  ///< [1] times that the constant of the angle has begun anew

 private:
  struct Line {
    double phase, rate, phase_std,
        rate_std;           // [rad], [rad/s] of the tooth-passing order at the newest sample
    double share, scatter;  // [1], [rad] of the phases about the line
  };
  void unlock();
  double searched(double frequency) const;
  Line lineAt(double frequency) const;
  double power(double frequency) const;

  OrderTrackerParameters parameters_;
  double speed_ = 0.0;
  std::size_t teeth_ = 0;
  double rate_ = 0.0;  // [Hz]
  std::optional<std::uint64_t> next_index_;
  std::deque<double> samples_;
  bool locked_ = false;
  std::size_t locks_ = 0;
  double searched_ = -1e9;             // [s] stamp of the last search
  double frequency_ = 0.0;             // [Hz] of the last line
  double turned_ = 0.0, stamp_ = 0.0;  // [rad] unwrapped phase of the order, [s] of the newest sample
};

}  // namespace smartmill
