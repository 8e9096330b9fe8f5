#pragma once

#include <array>
#include <vector>

#include "smartmill_core/cutting/tool.h"

namespace smartmill::loadmeter {

/// Force of one cut over the spindle angle.
struct AngleRecord {
  std::vector<double> angle;   ///< [rad] of tooth 1
  std::vector<double> fx, fy;  ///< [N] on the tool
  Engagement engagement;       ///< depth and feed too
};

/// Force per depth of cut over chip thickness as a monotone spline: cubic, its coefficients never fall
/// (Bachrathy and Stepan section 4 draw it point by point, for one tooth in cut).
struct ForceCurve {
  std::vector<double> knots;        ///< [m] breaks, from 0 to the thickest chip
  std::vector<double> value;        ///< [N/m] coefficients, rising
  std::vector<double> std_dev;      ///< [N/m] of the curve at the breaks
  double at(double chip) const;     ///< [N/m]; 0 without chip, straight on beyond the last break
  double slope(double chip) const;  ///< [N/m2]
  double stdAt(double chip) const;  ///< [N/m]
};

struct ForceCurves {
  ForceCurve tangential, radial;
  double rms = 0.0;  ///< [N] of what is left in fx, fy
};

/// Both curves of all records at once, by least squares over every sample with the sum over all teeth and
/// heights of the edge that are in cut: any number of teeth may cut. Band from what is left over,
/// neighbouring samples counted as far as they are correlated. @param pieces of the spline, 2..30
/// @throws Error when records are too short or no chip is cut.
ForceCurves fitForceCurves(const std::vector<AngleRecord>& records, const ToolGeometry& tool, int pieces = 8);

}  // namespace smartmill::loadmeter
