#pragma once

#include <array>
#include <deque>
#include <optional>

#include "smartmill_core/signal/streams.h"
#include "smartmill_loadmeter/calibration/machine_calibration.h"

namespace smartmill::loadmeter {

/// What a force sensor showed over the steady part of one test.
struct ForceReading {
  std::array<Estimate, 3> mean;               ///< [N] X, Y, Z on the tool
  std::array<double, 3> variance{{0, 0, 0}};  ///< [N2] about it
  std::array<double, 3> variance_std{{0, 0, 0}};

  /// Mean above that in air, where the sensor's zero was seen.
  Estimate meanOver(const std::optional<ForceReading>& air, std::size_t axis) const;
  /// Root mean square about the mean beyond what the sensor shows in air; empty where it is less.
  std::optional<Estimate> rmsOver(const std::optional<ForceReading>& air, std::size_t axis) const;
};

/// Blocks of force/compensated while a test is steady, each condensed to its sums.
class ForceRecord {
 public:
  void clear() { parts_.clear(); }
  /// Blocks of a filter that settles, and blocks with numbers that are not finite, do not count.
  void add(const ForceBlock& block);
  void dropAfter(double stamp);
  /// Of blocks that end after `since` [s]. Empty with fewer than 8 of them.
  std::optional<ForceReading> reading(double since = -1e300) const;

 private:
  struct Part {
    double end = 0.0, count = 0.0;
    std::array<double, 3> mean{{0, 0, 0}}, square{{0, 0, 0}};  // [N] and [N2], means over the block
  };
  std::deque<Part> parts_;
};

}  // namespace smartmill::loadmeter
