#pragma once

#include <array>
#include <string>
#include <vector>

namespace smartmill {

/// Cubic B-splines over even breaks from 0 to top, the ends' knots threefold: pieces + 3 of them.
/// @return the values of the four that are not 0 at x (0..top), the first's number in `first`
std::array<double, 4> cubicSplines(double x, double top, int pieces, int& first);

/// Force per depth of cut over chip thickness as a monotone spline: cubic, its coefficients never fall
/// (Bachrathy and Stepan section 4 draw it point by point, for one tooth in cut).
struct ForceCurve {
  std::vector<double> knots;        ///< [m] breaks, even, from 0 to the thickest chip
  std::vector<double> value;        ///< [N/m] coefficients, rising; as many as breaks and two
  std::vector<double> std_dev;      ///< [N/m] of the curve at the breaks
  double at(double chip) const;     ///< [N/m]; 0 without chip, straight on beyond the last break
  double slope(double chip) const;  ///< [N/m2]
  double stdAt(double chip) const;  ///< [N/m]
};

struct ForceCurves {
  ForceCurve tangential, radial;
  double rms = 0.0;      ///< [N] of what is left in fx, fy
  double scatter = 0.0;  ///< [1] of one cut's force against another's as a whole; not in the file
};

/// Curves with where they come from (topic material/force_curve).
struct IdentifiedForceCurves {
  double stamp = 0.0;  ///< [s] end of the last cut used
  std::string tool, material;
  int teeth = 0;                  ///< [1] of the tool
  std::vector<std::string> cuts;  ///< conditions used, oldest first
  ForceCurves curves;
};

/// YAML, format smartmill-force-curve/1. @throws Error.
void writeForceCurves(const ForceCurves& curves, const std::string& file);
/// @throws Error naming file and key: what is missing, falls, or does not fit together.
ForceCurves readForceCurves(const std::string& file);

}  // namespace smartmill
