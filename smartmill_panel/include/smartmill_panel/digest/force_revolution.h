#pragma once

#include <array>
#include <deque>
#include <optional>
#include <vector>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::panel {

struct RevolutionParameters {
  int bins = 256;

  void declare(ParameterTable& table) {
    table.number("revolution_bins", bins, "1", Range::closed(8, 4096),
                 "of the spindle's angle, over one revolution");
  }
};

/// Angle of the spindle at any time, from readings that may come late: linear between two readings, by the
/// nearest reading's speed beyond.
class AngleTrack {
 public:
  /// Time that goes back begins anew.
  void push(const SpindleAngle& reading);
  /// [rad] 0 .. 2 pi; empty: no reading near (REACH)
  std::optional<double> at(double time) const;
  /// [rad/s] of the newest reading; 0: none
  double speed() const { return readings_.empty() ? 0.0 : readings_.back().speed; }

  static constexpr double KEPT = 5.0;   ///< [s] of readings
  static constexpr double REACH = 0.5;  ///< [s] beyond the nearest reading

 private:
  std::deque<SpindleAngle> readings_;
};

/// Force over the spindle's angle: mean, least and largest of what fell into each bin.
struct ForceRevolution {
  double stamp = 0.0;          ///< [s] of the last sample
  double spindle_speed = 0.0;  ///< [rad/s]
  double revolutions = 0.0;    ///< [1] that it was made of
  std::size_t bins = 0;
  std::vector<float> mean, low, high;  ///< [N] all bins of fx, then of fy, then of fz; NaN: no sample
};

class RevolutionMaker {
 public:
  /// @throws Error on a parameter out of its bounds.
  explicit RevolutionMaker(const RevolutionParameters& parameters);

  /// Samples without a known angle, or while the spindle stands, are left out.
  void push(const ForceBlock& block, const AngleTrack& angle);
  /// What has gathered since the last call, once it is a whole revolution; empty before.
  std::optional<ForceRevolution> take();
  void forget();

 private:
  std::size_t bins_;
  double turned_ = 0.0;  // [rad]
  double stamp_ = 0.0, speed_ = 0.0;
  std::vector<double> sum_;
  std::vector<float> low_, high_;
  std::vector<int> count_;  // of the bin, the same for the three axes unless one is NaN
};

}  // namespace smartmill::panel
