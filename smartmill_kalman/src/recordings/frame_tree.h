#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>

#include "smartmill_recording/messages.h"

namespace smartmill::kalman {

/// Rotations between the frames of a recording, by the newest transform of each frame (topics /tf and
/// /tf_static).
class FrameTree {
 public:
  /// A transform with an empty name or without a unit quaternion is ignored.
  void add(const plain::TransformStamped& transform);

  /// Unit quaternion x, y, z, w: v_target = q v_source q*. Empty: no chain connects the frames.
  std::optional<std::array<double, 4>> rotation(const std::string& target, const std::string& source) const;

 private:
  using Quaternion = std::array<double, 4>;
  struct Link {
    std::string parent;
    Quaternion rotation{};  // v_parent = q v q*
  };
  struct Climb {
    std::string top;
    Quaternion rotation{};  // from the first frame to the top one
  };
  Climb climb(const std::string& from, const std::string& until) const;

  std::map<std::string, Link> links_;  // by the frame below
};

}  // namespace smartmill::kalman
