#include "smartmill_core/cutting/corner.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

/// Height of a slice above the corner where the edge is not straight.
struct SliceResolution {
  double pitch_change = 0.015;  ///< [rad] of the teeth over a slice, by a helix angle of each
  int wave_slices = 20;         ///< of a serration wave
  double cone_rise = 0.05;      ///< [1] height over the tool radius, of an inclined edge
};
constexpr SliceResolution RESOLUTION;

/// [1] Radius of the corner's centre below the tool radius, over the corner radius.
double centreInset(const ToolGeometry& tool) {
  return tool.edge.edge_angle == 0.5 * units::PI ? 1.0 : std::tan(0.5 * tool.edge.edge_angle);
}

// Integrals along the arc between two angles kappa, in closed form.
EdgeSlice cornerSlice(const ToolGeometry& tool, double from, double to) {
  const double corner_radius = tool.edge.corner_radius;
  const auto height = [&](double kappa) { return corner_radius * (1.0 - std::cos(kappa)); };
  EdgeSlice slice;
  slice.curved = true;
  slice.low = height(from);
  slice.high = height(to);
  const double rise = slice.high - slice.low, length = corner_radius * (to - from);
  const double square_of_sine =
      corner_radius * 0.5 * (to - from - 0.5 * (std::sin(2.0 * to) - std::sin(2.0 * from)));
  const double out = corner_radius * (std::sin(to) - std::sin(from));
  slice.length = length / rise;
  slice.edge_axial = out / length;
  slice.chip_radial = square_of_sine / rise;
  slice.chip_axial = 0.5 * corner_radius * (std::pow(std::sin(to), 2) - std::pow(std::sin(from), 2)) / rise;
  // Of the mean radius along the edge: the edge force, whose length per height is largest near the tip, has
  // its exact torque.
  slice.inset = corner_radius * (centreInset(tool) - rise / length);
  return slice;
}

double leanOf(double height, double corner_radius) {
  return std::acos(std::clamp(1.0 - height / corner_radius, -1.0, 1.0));
}

/// A slice above the corner.
EdgeSlice upperSlice(const ToolGeometry& tool, double low, double high) {
  EdgeSlice slice;
  slice.low = low;
  slice.high = high;
  if (tool.edge.edge_angle == 0.5 * units::PI) return slice;
  const double sine = std::sin(tool.edge.edge_angle), cosine = std::cos(tool.edge.edge_angle);
  slice.length = 1.0 / sine;
  slice.edge_axial = slice.chip_axial = cosine;
  slice.chip_radial = sine;
  slice.inset = -slice.middle() * cosine / sine;
  return slice;
}

/// [m] Of a slice above the corner; infinite where the edge is straight.
double sliceHeight(const ToolGeometry& tool) {
  double height = std::numeric_limits<double>::infinity();
  const EdgeShape& edge = tool.edge;
  for (int k = 0; k < tool.teeth && !edge.helix.empty(); ++k) {
    const double change = std::abs(tool.lagOf((k + 1) % tool.teeth) - tool.lagOf(k));
    if (change > 0.0) height = std::min(height, RESOLUTION.pitch_change / change);
  }
  if (edge.serrated()) height = std::min(height, edge.serration_wavelength / RESOLUTION.wave_slices);
  if (edge.edge_angle < 0.5 * units::PI) height = std::min(height, RESOLUTION.cone_rise * tool.radius());
  return height;
}

}  // namespace

double cornerHeight(const ToolGeometry& tool) {
  const EdgeShape& edge = tool.edge;
  return edge.edge_angle == 0.5 * units::PI ? edge.corner_radius
                                            : edge.corner_radius * (1.0 - std::cos(edge.edge_angle));
}

std::vector<EdgeSlice> edgeSlices(const ToolGeometry& tool, double height, int slices) {
  validate(tool.edge, tool);
  const double corner_radius = tool.edge.corner_radius, rise = sliceHeight(tool);
  std::vector<EdgeSlice> list;
  if (corner_radius > 0.0) {
    const double arc = tool.edge.edge_angle;
    const int count = std::max(slices, static_cast<int>(std::ceil(corner_radius * arc / rise)));
    const double step = arc / count;
    for (int k = 0; k < count; ++k) list.push_back(cornerSlice(tool, k * step, (k + 1) * step));
  }
  const double top = list.empty() ? 0.0 : list.back().high;
  if (std::isinf(rise)) {
    list.push_back(upperSlice(tool, top, rise));
  } else {
    for (int k = 0; list.empty() || list.back().high < height; ++k)
      list.push_back(upperSlice(tool, top + k * rise, top + (k + 1) * rise));
  }
  for (EdgeSlice& slice : list) {
    slice.turn = tool.lag() * slice.low;
    if (!tool.edge.helix.empty() && std::isfinite(slice.high))
      slice.turn = tool.lagOf(0) * slice.middle() - tool.lag() * (slice.middle() - slice.low);
  }
  return list;
}

EdgeSlice between(double low, double high, const EdgeSlice& slice, const ToolGeometry& tool) {
  if (low == slice.low && high == slice.high) return slice;
  const double corner_radius = tool.edge.corner_radius;
  EdgeSlice part = slice.curved ? cornerSlice(tool, leanOf(low, corner_radius), leanOf(high, corner_radius))
                                : upperSlice(tool, low, high);
  part.low = low;
  part.high = high;
  part.turn = slice.turn + tool.lag() * (low - slice.low);
  return part;
}

ToolGeometry toolOf(const EdgeSlice& slice, const ToolGeometry& tool) {
  ToolGeometry straight = tool;
  straight.edge = {};
  straight.diameter = tool.diameter - 2.0 * slice.inset;
  straight.helix = std::atan(tool.lag() * straight.radius());
  if (tool.edge.helix.empty() || std::isinf(slice.high)) return straight;
  straight.pitch.clear();
  for (int k = 0; k < tool.teeth; ++k) straight.pitch.push_back(tool.pitchAt(k, slice.middle()));
  return straight;
}

std::vector<double> radiiOf(const EdgeSlice& slice, const ToolGeometry& tool,
                            const std::vector<double>& radius_offset) {
  if (!tool.edge.serrated()) return radius_offset;
  std::vector<double> radii = radius_offset;
  radii.resize(static_cast<std::size_t>(tool.teeth));
  for (int k = 0; k < tool.teeth; ++k)
    radii[static_cast<std::size_t>(k)] += serrationAt(tool, k, slice.middle());
  return radii;
}

double serrationAt(const ToolGeometry& tool, int tooth, double height) {
  const EdgeShape& edge = tool.edge;
  if (!edge.serrated()) return 0.0;
  return edge.serration_amplitude * std::sin(units::TWO_PI * (height / edge.serration_wavelength +
                                                              static_cast<double>(tooth) / tool.teeth));
}

CuttingLaw lawOf(const EdgeSlice& slice, const CuttingLaw& law) {
  const CuttingCoefficients& k = law.coefficients;
  const double sine = 1.0 / slice.length;  // mean over the edge
  const double chip = std::pow(sine, -law.size_exponent), edge = slice.length;
  CuttingLaw leaning = law;
  leaning.coefficients = {chip * k.ktc,
                          chip * (slice.chip_radial * k.krc - slice.chip_axial * k.kac),
                          chip * (slice.chip_axial * k.krc + slice.chip_radial * k.kac),
                          edge * k.kte,
                          k.kre - edge * slice.edge_axial * k.kae,
                          edge * slice.edge_axial * k.kre + k.kae};
  leaning.edge_chip = law.edge_chip / sine;
  leaning.damping_radial = law.damping_radial * slice.chip_radial;
  leaning.damping_axial = law.damping_radial * slice.chip_axial;
  return leaning;
}

}  // namespace smartmill
