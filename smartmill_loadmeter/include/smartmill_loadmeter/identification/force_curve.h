#pragma once

#include <vector>

#include "smartmill_core/cutting/force_curve.h"
#include "smartmill_core/cutting/tool.h"

namespace smartmill::loadmeter {

/// Force of one cut over the spindle angle.
struct AngleRecord {
  std::vector<double> angle;   ///< [rad] of tooth 1
  std::vector<double> fx, fy;  ///< [N] on the tool
  Engagement engagement;       ///< with depth and feed
};

/// Fits the tangential and the radial curve to all records by least squares over every sample, with the sum
/// over all teeth and edge heights in cut; any number of teeth may cut. Unknowns of the records, in addition:
/// the chip-thickness offset of each tooth (runout) and an angle offset (delay of the forces, encoder zero).
/// The band contains the noise, the error of the splines (each half pitch of each record is one cluster) and
/// a scale factor of each record. @param pieces segments of each spline, 2..30
/// @throws Error when records are too short or no chip is cut.
ForceCurves fitForceCurves(const std::vector<AngleRecord>& records, const ToolGeometry& tool, int pieces = 8);

/// Widens the bands by the uncertainty common to all cuts. @param share [1] standard deviation of the force
/// sensor's gain
void widen(ForceCurves& curves, double share);

}  // namespace smartmill::loadmeter
