#include "smartmill_core/frames.h"

#include <cmath>

#include "smartmill_core/error.h"

namespace smartmill::frames {

std::array<double, 9> rotationMatrix(const std::array<double, 4>& quaternion) {
  const auto [qx, qy, qz, qw] = quaternion;
  const double length = std::sqrt(qx * qx + qy * qy + qz * qz + qw * qw);
  if (!(std::abs(length - 1.0) < 1e-3)) {
    throw Error("transform: its quaternion has length " + std::to_string(length) + ", expected 1");
  }
  const double x = qx / length, y = qy / length, z = qz / length, w = qw / length;
  return {1 - 2 * (y * y + z * z), 2 * (x * y - z * w),     2 * (x * z + y * w),
          2 * (x * y + z * w),     1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
          2 * (x * z - y * w),     2 * (y * z + x * w),     1 - 2 * (x * x + y * y)};
}

std::array<double, 3> rotate(const std::array<double, 9>& m, const std::array<double, 3>& v) {
  return {m[0] * v[0] + m[1] * v[1] + m[2] * v[2], m[3] * v[0] + m[4] * v[1] + m[5] * v[2],
          m[6] * v[0] + m[7] * v[1] + m[8] * v[2]};
}

}  // namespace smartmill::frames
