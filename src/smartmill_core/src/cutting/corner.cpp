#include "smartmill_core/cutting/corner.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

constexpr double ROUNDING = 1e-9;

// Integrals along the arc between two angles kappa, in closed form.
EdgeSlice cornerSlice(double corner_radius, double from, double to) {
  const auto height = [&](double kappa) { return corner_radius * (1.0 - std::cos(kappa)); };
  EdgeSlice slice;
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
  slice.inset = corner_radius * (1.0 - slice.chip_radial);
  return slice;
}

double leanOf(double height, double corner_radius) {
  return std::acos(std::clamp(1.0 - height / corner_radius, -1.0, 1.0));
}

}  // namespace

std::vector<EdgeSlice> edgeSlices(const ToolGeometry& tool, double corner_radius, int slices) {
  if (!(corner_radius >= 0.0) || corner_radius > tool.radius() * (1.0 + ROUNDING)) {
    throw Error("a corner radius of " + std::to_string(corner_radius / units::MM) +
                " mm does not fit a tool of radius " + std::to_string(tool.radius() / units::MM) + " mm");
  }
  std::vector<EdgeSlice> list;
  for (int k = 0; k < slices && corner_radius > 0.0; ++k) {
    const double step = 0.5 * units::PI / slices;
    list.push_back(cornerSlice(corner_radius, k * step, (k + 1) * step));
  }
  EdgeSlice upright;
  upright.low = list.empty() ? 0.0 : list.back().high;
  list.push_back(upright);
  return list;
}

EdgeSlice upTo(double height, const EdgeSlice& slice, double corner_radius) {
  return cornerSlice(corner_radius, leanOf(slice.low, corner_radius), leanOf(height, corner_radius));
}

ToolGeometry toolOf(const EdgeSlice& slice, const ToolGeometry& tool) {
  ToolGeometry straight = tool;
  straight.diameter = tool.diameter - 2.0 * slice.inset;
  straight.helix = std::atan(tool.lag() * straight.radius());
  return straight;
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
