#pragma once

#include <string>
#include <vector>

namespace smartmill::discovery {

/// Depths at which a slot is safely stable by the chart of the model in use.
class BelievedLimits {
 public:
  /// No limit: a model without modes.
  BelievedLimits() = default;
  /// @param chart file of `lobes`, slots @param share [1] of the limit that may be used @throws Error.
  BelievedLimits(const std::string& chart, double share);

  /// [m] Largest depth at a speed [rad/s]: the share of the least limit of speeds within 2 %; infinite where
  /// the chart has none.
  double depthAt(double speed) const;

 private:
  struct Limit {
    double speed, depth;  // [rad/s], [m]
  };
  std::vector<Limit> limits_;
};

}  // namespace smartmill::discovery
