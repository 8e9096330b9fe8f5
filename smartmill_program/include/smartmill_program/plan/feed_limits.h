#pragma once

#include <cstddef>
#include <limits>

namespace smartmill::program {

/// What bounds the feed of a block.
enum class FeedLimit { none, force, torque, power, chip, feed_per_tooth, machine, acceleration, no_model };
constexpr std::size_t FEED_LIMITS = 9;
/// "force", "feed per tooth", ...
const char* nameOf(FeedLimit limit);

/// Limits of a feed plan; infinite: not limited.
struct FeedLimits {
  static constexpr double UNLIMITED = std::numeric_limits<double>::infinity();

  double force = UNLIMITED;           ///< [N] peak across the tool axis
  double torque = UNLIMITED;          ///< [N m] peak of the spindle
  double power = UNLIMITED;           ///< [W] mean of the cut
  double chip = UNLIMITED;            ///< [m] largest chip thickness
  double feed_per_tooth = UNLIMITED;  ///< [m] along the path
  double machine = UNLIMITED;         ///< [m/s] feed of the machine; has to be finite
  /// [m/s2] of the axes, along the path and towards the centre of an arc; infinite: not considered
  double acceleration = UNLIMITED;
  double least_chip = 0.0;  ///< [m] of the largest chip thickness of a block; reported only

  /// @throws Error naming a limit that is not above 0, and when nothing limits the chip or the machine's feed
  void validate() const;
};

/// A largest feed [m/s] and what bounds it.
struct FeedBound {
  double feed = FeedLimits::UNLIMITED;
  FeedLimit limit = FeedLimit::none;

  void lower(double other, FeedLimit by) {
    if (!(other < feed)) return;
    feed = other;
    limit = by;
  }
};

}  // namespace smartmill::program
