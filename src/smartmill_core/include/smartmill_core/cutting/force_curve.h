#pragma once

#include <array>
#include <string>
#include <vector>

namespace smartmill {

/// The four cubic B-splines that are nonzero at x, over even breaks from 0 to top with triple knots at the
/// ends: pieces + 3 of them. Linear outside 0..top.
struct CubicSplines {
  CubicSplines(double x, double top, int pieces);

  int first = 0;                                                  ///< index of the first of them
  std::array<double, 4> value{}, slope{};                         ///< [1], [1/unit of x]
  double valueOf(const std::vector<double>& coefficients) const;  ///< of the curve with these coefficients
  double slopeOf(const std::vector<double>& coefficients) const;
};

/// Force per depth of cut over chip thickness as a monotone cubic spline: its coefficients never decrease
/// (Bachrathy and Stepan, section 4, determine it point by point with one tooth in the cut).
struct ForceCurve {
  std::vector<double> knots;        ///< [m] evenly spaced breaks from 0 to the thickest chip
  std::vector<double> value;        ///< [N/m] coefficients, rising; two more than breaks
  std::vector<double> std_dev;      ///< [N/m] of the curve at the breaks
  double at(double chip) const;     ///< [N/m]; 0 at zero chip, linear beyond the last break
  double slope(double chip) const;  ///< [N/m2]
  double stdAt(double chip) const;  ///< [N/m]
};

struct ForceCurves {
  ForceCurve tangential, radial;
  double rms = 0.0;      ///< [N] of the residual in fx, fy
  double scatter = 0.0;  ///< [1] scatter of the force as a whole from cut to cut; not in the file
};

/// Force curves with their origin (topic material/force_curve).
struct IdentifiedForceCurves {
  double stamp = 0.0;  ///< [s] end of the last cut used
  std::string tool, material;
  int teeth = 0;                  ///< [1] of the tool
  std::vector<std::string> cuts;  ///< conditions used, oldest first
  ForceCurves curves;
};

/// YAML, format smartmill-force-curve/1. @throws Error.
void writeForceCurves(const ForceCurves& curves, const std::string& file);
/// @throws Error naming file and key: missing key, decreasing values, inconsistent sizes.
ForceCurves readForceCurves(const std::string& file);

}  // namespace smartmill
