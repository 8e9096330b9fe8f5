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

struct CurveFitOptions {
  double largest_angle_offset = 0.1;  ///< [rad] bound of the delay of the forces and the encoder's zero
  double largest_chip_offset = 0.5;   ///< [1] bound of a tooth's chip offset over the thickest chip
  int edge_slices = 12;               ///< [1] of a helical edge over its height
  int iterations = 4;                 ///< [1] of Gauss-Newton for chip and angle offsets
};

/// Fits the tangential and the radial curve to all records by least squares over every sample, with the sum
/// over all teeth and edge heights in cut; any number of teeth may cut. Unknowns of the records, in addition:
/// the chip-thickness offset of each tooth (runout) and an angle offset (delay of the forces, encoder zero).
/// The band contains the noise, the error of the splines (each half pitch of each record is one cluster) and
/// a scale factor of each record. @param pieces segments of each spline, 2..30
/// @throws Error when records are too short or no chip is cut.
ForceCurves fitForceCurves(const std::vector<AngleRecord>& records, const ToolGeometry& tool, int pieces = 8,
                           const CurveFitOptions& options = {});

/// Widens the bands by the uncertainty common to all cuts. @param share [1] standard deviation of the force
/// sensor's gain
void widen(ForceCurves& curves, double share);

}  // namespace smartmill::loadmeter
