#pragma once

namespace smartmill {

/// Shop units <-> SI, used only for files and displayed numbers.
namespace units {

constexpr double PI = 3.14159265358979323846;
constexpr double TWO_PI = 2.0 * PI;

constexpr double radPerSecFromRpm(double rpm) {
  return rpm * TWO_PI / 60.0;
}
constexpr double rpmFromRadPerSec(double speed) {
  return speed * 60.0 / TWO_PI;
}
constexpr double radFromDeg(double deg) {
  return deg * PI / 180.0;
}
constexpr double degFromRad(double rad) {
  return rad * 180.0 / PI;
}

constexpr double MM = 1e-3;               // [m]
constexpr double UM = 1e-6;               // [m]
constexpr double N_PER_MM2 = 1e6;         // [N/m2]
constexpr double N_PER_MM = 1e3;          // [N/m]
constexpr double N_PER_UM = 1e6;          // [N/m]
constexpr double M_PER_MIN = 1.0 / 60.0;  // [m/s]

}  // namespace units
}  // namespace smartmill
