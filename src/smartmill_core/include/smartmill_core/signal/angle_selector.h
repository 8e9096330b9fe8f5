#pragma once

#include <complex>
#include <cstddef>
#include <deque>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/signal/angle_track.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill {

/// The spindle angle of the best source that works.
///
/// Sources are ordered, the best first. One that gives no reading for its time-out fails and the next one
/// takes over, with the readings that it has given since the last published one; a better source takes over
/// at once, but after a failure only when it has worked for HOLD. While another source is used, the
/// difference of the angles is averaged; a source that takes over is turned by it, so that the angle
/// continues. Time is that of the stamps; a backward jump begins anew.
class AngleSelector {
 public:
  struct Source {
    std::string name;
    double timeout = 0.15;  ///< [s] without a reading
    bool absolute = true;   ///< its own zero is known; false: up to a constant
  };
  struct State {
    bool working = false, offset_known = false;
    double newest = -std::numeric_limits<double>::infinity();  ///< [s] stamp of its last reading
    double offset = 0.0, offset_std = 0.0;  ///< [rad] that is added to its angle; of the average
  };

  explicit AngleSelector(std::vector<Source> sources);

  /// @return readings to publish, in time order
  std::vector<SpindleAngle> push(std::size_t source, const SpindleAngle& reading);
  /// Time has come this far without a reading. @param time [s] @return as push()
  std::vector<SpindleAngle> advance(double time);
  /// The constant of a source that is known up to one has begun anew.
  void forgetOffset(std::size_t source);
  /// @param timeout [s] of a source whose readings come as often as the spindle turns
  void setTimeout(std::size_t source, double timeout) { sources_[source].timeout = timeout; }

  std::optional<std::size_t> active() const { return active_; }
  /// Whether the published angle is related to tooth 1.
  bool related() const;
  const Source& source(std::size_t index) const { return sources_[index]; }
  std::size_t size() const { return sources_.size(); }
  State state(std::size_t source) const;
  const SpindleAngle& published() const { return last_; }
  /// "pulses in place of encoder: no reading for 0.15 s"; empty: no change since the last call.
  std::string takeChange();

  static constexpr double HOLD = 1.0;      ///< [s] of a source that works again: longer than the time-outs
  static constexpr double AVERAGED = 1.0;  ///< [s] time constant of the difference of two sources

 private:
  struct Entry {
    double newest = -std::numeric_limits<double>::infinity(), since = 0.0;  // [s]
    bool angle_known = false, has_failed = false;
    std::deque<SpindleAngle> recent;     // of the last time-out
    std::complex<double> difference;     // weighted sum of unit vectors
    double weight = 0.0, squares = 0.0;  // sums of weights and of their squares
    double related_to = 0.0;             // [s] stamp of the last difference
    double offset = 0.0;                 // [rad] fixed when it took over
  };
  void reset();
  bool works(std::size_t source) const;
  void learn(std::size_t source, const SpindleAngle& reading);
  void choose(std::vector<SpindleAngle>& out);
  void publish(const SpindleAngle& reading, std::vector<SpindleAngle>& out);

  std::vector<Source> sources_;
  std::vector<Entry> entries_;
  std::optional<std::size_t> active_;
  bool related_ = false;
  double now_ = -std::numeric_limits<double>::infinity();  // [s]
  AngleTrack track_;                                       // published
  SpindleAngle last_;
  std::string change_;
};

}  // namespace smartmill
