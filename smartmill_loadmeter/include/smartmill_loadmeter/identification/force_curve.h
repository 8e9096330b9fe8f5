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
/// heights of the edge that are in cut: any number of teeth may cut. Found beside them: how much thicker each
/// tooth's chip is than the feed's (runout), and by how much the angle is early (a delay of the forces, the
/// encoder's zero). The band holds noise, what the splines leave (each half pitch of each record is one
/// witness), and by how much one record's force differs from another's as a whole. @param pieces of the
/// spline, 2..30
/// @throws Error when records are too short or no chip is cut.
ForceCurves fitForceCurves(const std::vector<AngleRecord>& records, const ToolGeometry& tool, int pieces = 8);

/// Widens the bands by what is the same in all cuts, which none of them can show. @param share [1] standard
/// deviation of the force sensor's gain
void widen(ForceCurves& curves, double share);

}  // namespace smartmill::loadmeter
