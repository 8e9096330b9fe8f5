#pragma once

#include <limits>
#include <vector>

#include "smartmill_core/cutting/cutting_law.h"
#include "smartmill_core/cutting/tool.h"

namespace smartmill {

/// A stretch of the height of an edge that is cut as by a straight mill of its own.
///
/// Below its corner radius r the edge of a bull-nose mill runs along a quarter of a circle, of a ball end (r
/// = R) to the axis: at height z its normal leans from the tool's axis by kappa, cos(kappa) = 1 - z / r
/// (Altintas & Lee 1996; Engin & Altintas 2001, general end mill). There the chip is sin(kappa) times the
/// distance to the surface across the tool, the local radius is R - r (1 - sin(kappa)), a height dz holds dz
/// / sin(kappa) of edge, and radial and axial force turn with the normal,
///
///     across the tool: Fr sin(kappa) - Fa cos(kappa)      along it: Fr cos(kappa) + Fa sin(kappa)
///
/// so that Fr always pushes the edge out of the work and an upright edge has Fr and Fa. The angle by which
/// the edge lags is that of a straight mill, z tan(helix) / R.
struct EdgeSlice {
  double low = 0.0;                                       ///< [m] above the tip
  double high = std::numeric_limits<double>::infinity();  ///< [m]

  // Means over the slice, all over its height; of an upright edge as they stand here.
  double length = 1.0;       ///< [1] of edge
  double edge_axial = 0.0;   ///< [1] cos(kappa) over the edge's length
  double chip_radial = 1.0;  ///< [1] sin(kappa) over what a chip gets, which goes with sin(kappa) itself
  double chip_axial = 0.0;   ///< [1] cos(kappa), the same
  double inset = 0.0;        ///< [m] of the local radius from that of the tool
};

constexpr int CORNER_SLICES = 12;  ///< of a quarter of a circle

/// The slices of a mill with a corner radius [m], from the tip; the last has no upper end. Within a slice of
/// the corner only the turn of the edge by its helix is taken for even.
/// @param slices > 0, of the corner. @throws Error on a corner radius below 0 or above the tool's.
std::vector<EdgeSlice> edgeSlices(const ToolGeometry& tool, double corner_radius, int slices = CORNER_SLICES);

/// The part of a slice of the corner up to a height [m] within it.
EdgeSlice upTo(double height, const EdgeSlice& slice, double corner_radius);

/// The straight mill that cuts like a slice: same lag with height, local radius.
ToolGeometry toolOf(const EdgeSlice& slice, const ToolGeometry& tool);

/// Its law.
CuttingLaw lawOf(const EdgeSlice& slice, const CuttingLaw& law);

}  // namespace smartmill
