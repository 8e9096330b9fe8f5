#pragma once

#include <array>

namespace smartmill::frames {

// tf2 frames: machine -> spindle -> tool_tip, spindle_sensor; machine -> table -> dynamometer; machine ->
// hammer.
constexpr const char* MACHINE = "machine";
constexpr const char* SPINDLE = "spindle";
constexpr const char* TOOL_TIP = "tool_tip";
constexpr const char* SPINDLE_SENSOR = "spindle_sensor";
constexpr const char* TABLE = "table";
constexpr const char* DYNAMOMETER = "dynamometer";
constexpr const char* HAMMER = "hammer";

/// Row-major rotation matrix of a unit quaternion x, y, z, w: v_target = R v_source for the rotation part of
/// a tf2 transform from source to target. @throws Error when the quaternion is not of unit length.
std::array<double, 9> rotationMatrix(const std::array<double, 4>& quaternion);

/// The same for a message's quaternion with members x, y, z and w.
template <class Quaternion>
std::array<double, 9> rotationMatrix(const Quaternion& q) {
  return rotationMatrix(std::array<double, 4>{q.x, q.y, q.z, q.w});
}

/// Rotates a vector (unit kept) by a row-major matrix.
std::array<double, 3> rotate(const std::array<double, 9>& matrix, const std::array<double, 3>& v);

}  // namespace smartmill::frames
