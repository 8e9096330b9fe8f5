#pragma once

#include <array>
#include <optional>
#include <vector>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/angle_track.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::panel {

struct RevolutionParameters {
  int bins = 256;

  void declare(ParameterTable& table) {
    table.number("revolution_bins", bins, "1", Range::closed(8, 4096),
                 "angle bins per revolution of the spindle");
  }
};

/// Force over the spindle angle: mean, minimum and maximum of the samples in each bin.
struct ForceRevolution {
  double stamp = 0.0;          ///< [s] of the last sample
  double spindle_speed = 0.0;  ///< [rad/s]
  double revolutions = 0.0;    ///< [1] number of revolutions used
  std::size_t bins = 0;
  std::vector<float> mean, low, high;  ///< [N] all bins of fx, then of fy, then of fz; NaN: no sample
};

class RevolutionMaker {
 public:
  /// @throws Error on a parameter out of its bounds.
  explicit RevolutionMaker(const RevolutionParameters& parameters);

  /// Ignores samples without a known angle or with the spindle stopped.
  void push(const ForceBlock& block, const AngleTrack& angle);
  /// Result since the last call; empty before a full revolution.
  std::optional<ForceRevolution> take();
  void reset();

 private:
  std::size_t bins_;
  double turned_ = 0.0;  // [rad]
  double stamp_ = 0.0, speed_ = 0.0;
  std::vector<double> sum_;
  std::vector<float> low_, high_;
  std::vector<int> count_;  // samples of each bin and axis
};

}  // namespace smartmill::panel
