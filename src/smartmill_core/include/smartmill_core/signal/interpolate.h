#pragma once

namespace smartmill {

/// Catmull-Rom interpolation of four evenly spaced samples between the second and the third.
/// @param share [1] of the interval from b to c, 0 to 1
inline double catmullRom(double a, double b, double c, double d, double share) {
  return b +
         0.5 * share * (c - a + share * (2.0 * a - 5.0 * b + 4.0 * c - d + share * (3.0 * (b - c) + d - a)));
}

/// Its slope [1/sample].
inline double catmullRomSlope(double a, double b, double c, double d, double share) {
  return 0.5 * (c - a) + share * (2.0 * a - 5.0 * b + 4.0 * c - d + 1.5 * share * (3.0 * (b - c) + d - a));
}

}  // namespace smartmill
