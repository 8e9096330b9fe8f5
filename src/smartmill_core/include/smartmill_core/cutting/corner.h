#pragma once

#include <limits>
#include <vector>

#include "smartmill_core/cutting/cutting_law.h"
#include "smartmill_core/cutting/tool.h"

namespace smartmill {

/// A range of height of an edge that cuts like a straight end mill.
///
/// Below its corner radius r the edge of a bull-nose mill follows a quarter circle, which reaches the axis
/// for a ball end (r = R). At height z its normal is inclined to the tool axis by kappa, cos(kappa) = 1 - z /
/// r (Altintas & Lee 1996; Engin & Altintas 2001, general end mill). There the chip is sin(kappa) times the
/// distance to the surface across the tool, the local radius is R - r (1 - sin(kappa)), a height dz contains
/// an edge length dz / sin(kappa), and radial and axial force rotate with the normal,
///
///     across the tool: Fr sin(kappa) - Fa cos(kappa)      along it: Fr cos(kappa) + Fa sin(kappa)
///
/// so that Fr always pushes the edge out of the work, and a vertical edge has Fr and Fa themselves. The lag
/// angle of the edge is that of a straight mill, z tan(helix) / R.
struct EdgeSlice {
  double low = 0.0;                                       ///< [m] above the tip
  double high = std::numeric_limits<double>::infinity();  ///< [m]

  // Means over the slice, relative to its height. The defaults are those of a vertical edge.
  double length = 1.0;       ///< [1] of edge
  double edge_axial = 0.0;   ///< [1] cos(kappa) over the edge's length
  double chip_radial = 1.0;  ///< [1] sin(kappa), weighted by the chip, which is proportional to sin(kappa)
  double chip_axial = 0.0;   ///< [1] cos(kappa), weighted in the same way
  double inset = 0.0;        ///< [m] tool radius minus local radius
};

constexpr int CORNER_SLICES = 12;  ///< of a quarter of a circle

/// The slices of a mill with a corner radius [m], from the tip; the last has no upper end. Within a slice of
/// the corner only the lag by the helix is taken as uniform.
/// @param slices > 0, of the corner. @throws Error on a corner radius below 0 or above the tool's.
std::vector<EdgeSlice> edgeSlices(const ToolGeometry& tool, double corner_radius, int slices = CORNER_SLICES);

/// The portion of a corner slice below a height [m] within it.
EdgeSlice upTo(double height, const EdgeSlice& slice, double corner_radius);

/// The straight mill that cuts like a slice: same lag with height, local radius.
ToolGeometry toolOf(const EdgeSlice& slice, const ToolGeometry& tool);

/// The cutting law of that mill.
CuttingLaw lawOf(const EdgeSlice& slice, const CuttingLaw& law);

}  // namespace smartmill
