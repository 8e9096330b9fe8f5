#pragma once

#include <limits>
#include <vector>

#include "smartmill_core/cutting/cutting_law.h"
#include "smartmill_core/cutting/tool.h"

namespace smartmill {

/// A range of height of an edge that cuts like a straight end mill.
///
/// Below its corner radius r the edge of a bull-nose mill follows an arc, which reaches the axis for a ball
/// end (r = R), and above it the edge has the angle kappa_r (pi/2: cylinder, below: face mill). At height z
/// the normal of the edge is inclined to the tool axis by kappa, in the corner cos(kappa) = 1 - z / r
/// (Altintas & Lee 1996; Engin & Altintas 2001, general end mill). There the chip is sin(kappa) times the
/// distance to the surface across the tool, the local radius is R - r (tan(kappa_r / 2) - sin(kappa)) in the
/// corner and R + z / tan(kappa_r) above it, a height dz contains an edge length dz / sin(kappa), and radial
/// and axial force rotate with the normal,
///
///     across the tool: Fr sin(kappa) - Fa cos(kappa)      along it: Fr cos(kappa) + Fa sin(kappa)
///
/// so that Fr always pushes the edge out of the work, and a vertical edge has Fr and Fa themselves. The lag
/// angle of the edge is that of a straight mill, z tan(helix) / R. With a helix angle of each tooth the pitch
/// changes with height, with a serrated edge the radius of each tooth; both are those of the middle of the
/// slice.
struct EdgeSlice {
  double low = 0.0;                                       ///< [m] above the tip
  double high = std::numeric_limits<double>::infinity();  ///< [m]

  // Means over the slice, relative to its height. The defaults are those of a vertical edge.
  double length = 1.0;       ///< [1] of edge
  double edge_axial = 0.0;   ///< [1] cos(kappa) over the edge's length
  double chip_radial = 1.0;  ///< [1] sin(kappa), weighted by the chip, which is proportional to sin(kappa)
  double chip_axial = 0.0;   ///< [1] cos(kappa), weighted in the same way
  double inset = 0.0;        ///< [m] tool radius minus local radius

  bool curved = false;  ///< part of the corner
  double turn = 0.0;    ///< [rad] by which tooth 1 of toolOf() at the slice's lower end lags behind the tip

  /// [1] cot(kappa), mean over the height: across the tool an axial feed advances the edge by this share.
  double lean() const { return length * edge_axial; }
  /// [m] Of a slice with an upper end.
  double middle() const { return 0.5 * (low + high); }
};

constexpr int CORNER_SLICES = 12;  ///< of the corner's arc

/// [m] Height of the corner: where its arc ends.
double cornerHeight(const ToolGeometry& tool);

/// The slices of a mill from the tip up to a height [m] at least; the last has no upper end where the edge
/// above the corner is a straight one. Within a slice of the corner only the lag by the helix is taken as
/// uniform.
/// @param slices > 0, of the corner; more where another shape of the edge requires it. @throws Error on an
/// invalid shape, and on edges that meet (ToolGeometry::pitchAt()).
std::vector<EdgeSlice> edgeSlices(const ToolGeometry& tool, double height, int slices = CORNER_SLICES);

/// The portion of a slice between two heights [m] within it.
EdgeSlice between(double low, double high, const EdgeSlice& slice, const ToolGeometry& tool);

/// The straight mill that cuts like a slice: same mean lag with height, local radius and pitch.
ToolGeometry toolOf(const EdgeSlice& slice, const ToolGeometry& tool);

/// [m] Radii of its teeth over the local one. @param radius_offset [m] of the tool's teeth; empty: none
std::vector<double> radiiOf(const EdgeSlice& slice, const ToolGeometry& tool,
                            const std::vector<double>& radius_offset);

/// [m] Radius of tooth k at a height over that of a smooth edge.
double serrationAt(const ToolGeometry& tool, int tooth, double height);

/// The cutting law of that mill.
CuttingLaw lawOf(const EdgeSlice& slice, const CuttingLaw& law);

}  // namespace smartmill
