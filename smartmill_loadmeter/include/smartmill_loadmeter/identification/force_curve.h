#pragma once

#include <vector>

#include "smartmill_core/cutting/force_curve.h"
#include "smartmill_core/cutting/tool.h"

namespace smartmill::loadmeter {

/// Force of one cut over the spindle angle.
struct AngleRecord {
  std::vector<double> angle;   ///< [rad] of tooth 1
  std::vector<double> fx, fy;  ///< [N] on the tool
  Engagement engagement;       ///< depth and feed too
};

/// Both curves of all records at once, by least squares over every sample with the sum over all teeth and
/// heights of the edge that are in cut: any number of teeth may cut. Band from what is left over,
/// neighbouring samples counted as far as they are correlated. @param pieces of the spline, 2..30
/// @throws Error when records are too short or no chip is cut.
ForceCurves fitForceCurves(const std::vector<AngleRecord>& records, const ToolGeometry& tool, int pieces = 8);

}  // namespace smartmill::loadmeter
