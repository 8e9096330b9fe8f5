#pragma once

#include <array>
#include <map>
#include <string>

namespace smartmill {

/// Pose of a tf2 frame in its parent: v_parent = R v + position.
struct FramePose {
  std::string parent;
  std::array<double, 3> position{{0, 0, 0}};     ///< [m] of its origin
  std::array<double, 4> rotation{{0, 0, 0, 1}};  ///< unit quaternion x, y, z, w
};

/// Fixed frames of a machine by name (smartmill_core/frames.h).
using FramePoses = std::map<std::string, FramePose>;

/// Frames that a model may state: table, dynamometer, hammer, tool_tip, spindle_sensor; aligned, each at the
/// origin of its usual parent.
const FramePoses& usualFrames();

/// Position [m] and row-major rotation of a frame in another, which must be above it.
struct PlacedFrame {
  std::array<double, 3> position{{0, 0, 0}};
  std::array<double, 9> rotation{{1, 0, 0, 0, 1, 0, 0, 0, 1}};

  bool isTurned() const;  ///< by more than rounding
  /// Force and moment about this frame's origin [N], [N m] as force and moment about the origin of the other:
  /// F = R f, M = R m + position x F.
  void carry(std::array<double, 3>& force, std::array<double, 3>& moment) const;
};
/// @param frames of a model, completed by usualFrames() @throws Error when no chain leads from one to the
/// other.
PlacedFrame placedFrame(const FramePoses& frames, const std::string& frame, const std::string& in);

}  // namespace smartmill
