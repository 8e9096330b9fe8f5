#pragma once

#include <cstdint>
#include <deque>
#include <vector>

namespace smartmill::daq {

struct SampleClockParameters {
  double bin = 0.05;       ///< [s] of which the earliest arrival is kept
  double window = 120.0;   ///< [s] of the fit: long enough for the frames of USB to beat with the samples,
                           ///< short enough for a crystal that warms up (docs/daq.md)
  double jump = 1e-3;      ///< [s] by which arrivals leave the line before the clock counts as set
  double jump_time = 2.0;  ///< [s] of late arrivals before they are a jump and not a stall
};

/// What is known of the device's clock against the computer's.
struct ClockState {
  double offset = 0.0;  ///< [s] of the line at the last sample against the nominal rate from the first one on
  double offset_std = 0.0;  ///< [s] standard deviation from the jitter of the arrivals
  double drift = 0.0;       ///< [1] excess of the sample period over its nominal value
  double drift_std = 0.0;   ///< [1]
  double span = 0.0;        ///< [s] that the fit uses
  double jitter = 0.0;      ///< [s] median delay of the earliest arrivals of the bins
  std::uint64_t jumps = 0;  ///< [1] times that a clock was set or samples went missing unannounced
  double last_jump = 0.0;   ///< [s] > 0: arrivals later than before
};

/// Times of samples by counting. A sample cannot arrive before it is taken, so the arrivals lie above the
/// straight line of the true times; the line is the edge of their lower convex hull below their mean, which
/// of all lines below the points has the least sum of distances (S. Moon, P. Skelly, D. Towsley: Estimation
/// and removal of clock skew from network delay measurements, INFOCOM 1999). The shortest delay is a constant
/// that arrivals cannot show.
class SampleClock {
 public:
  /// @param rate [Hz] nominal
  explicit SampleClock(double rate, const SampleClockParameters& parameters = {});

  /// @param count [1] running index behind the last sample of a batch @param arrival [s] @return whether the
  /// line began anew because arrivals have jumped
  bool add(std::uint64_t count, double arrival);

  /// Whether anything has arrived.
  bool begun() const { return begun_; }
  /// [s] by the computer's clock at which a sample is complete, plus the shortest delay. @param count [1] of
  /// samples up to its end, may lie ahead
  double timeOf(double count) const;
  const ClockState& state() const { return state_; }

  /// After an interruption: the offset is unknown, the drift stays. @param count [1] of the next sample
  void restart(std::uint64_t count);

 private:
  struct Point {
    double x, r;  // [s] nominal time since the origin, delay against it
  };
  double line(double x) const { return state_.offset + state_.drift * (x - last_x_); }
  void fit();
  bool jumped(const Point& point);

  double rate_;
  SampleClockParameters parameters_;
  bool begun_ = false;
  std::uint64_t origin_count_ = 0;
  double origin_ = 0.0, last_x_ = 0.0;  // [s]
  double bin_begin_ = 0.0, late_since_ = -1.0;
  double known_drift_ = 0.0;
  std::deque<Point> points_;  // the last one is of the open bin
  ClockState state_;
};

}  // namespace smartmill::daq
