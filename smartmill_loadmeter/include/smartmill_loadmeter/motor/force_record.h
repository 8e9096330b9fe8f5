#pragma once

#include <array>
#include <deque>
#include <optional>

#include "smartmill_core/signal/streams.h"
#include "smartmill_loadmeter/calibration/machine_calibration.h"

namespace smartmill::loadmeter {

/// Force by a force sensor over the steady state of one test.
struct ForceMeasurement {
  std::array<Estimate, 3> mean;               ///< [N] X, Y, Z on the tool
  std::array<double, 3> variance{{0, 0, 0}};  ///< [N2] about the mean
  std::array<double, 3> variance_std{{0, 0, 0}};

  /// Mean minus that in air, which measures the sensor's zero.
  Estimate meanAbove(const std::optional<ForceMeasurement>& air, std::size_t axis) const;
  /// RMS about the mean without the sensor's noise in air; empty: not significant.
  std::optional<Estimate> rmsAbove(const std::optional<ForceMeasurement>& air, std::size_t axis) const;
};

/// Sums of the blocks of force/compensated during a steady test.
class ForceRecord {
 public:
  void clear() { blocks_.clear(); }
  /// Ignores blocks of a settling filter and blocks with values that are not finite.
  void add(const ForceBlock& block);
  void dropAfter(double stamp);
  /// From the blocks that end after `since` [s]. Empty with fewer than 8 of them.
  std::optional<ForceMeasurement> measurement(double since = -1e300) const;

 private:
  struct BlockSums {
    double end = 0.0, count = 0.0;
    std::array<double, 3> mean{{0, 0, 0}}, square{{0, 0, 0}};  // [N] and [N2], means over the block
  };
  std::deque<BlockSums> blocks_;
};

}  // namespace smartmill::loadmeter
