#include "plant/cutting.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/units.h"

namespace smartmill::plant {

Teeth teethOf(const Plant& plant, const Hidden& hidden) {
  Teeth teeth;
  const int count = plant.tool.teeth;
  std::vector<double> pitch = plant.tool.pitch;
  if (pitch.empty()) pitch.assign(count, units::TWO_PI / count);
  const std::vector<double> uneven = hidden.list("uneven_pitch", "pitch_deg");
  for (std::size_t k = 0; k < uneven.size(); ++k) pitch[k] = units::radFromDeg(uneven[k]);
  const double radius = 0.5 * plant.tool.diameter;
  const std::vector<double> offsets = hidden.list("tooth_radius", "offset_um");
  double at = 0.0;
  for (int k = 0; k < count; ++k) {
    const double runout = units::UM * hidden("runout", "offset_um");
    teeth.angle.push_back(at);
    teeth.radius.push_back(radius + runout * std::cos(units::radFromDeg(hidden("runout", "angle_deg")) - at) +
                           (offsets.empty() ? 0.0 : units::UM * offsets[k]));
    at += pitch[k];
  }
  const double helix =
      hidden.has("helix") ? units::radFromDeg(hidden("helix", "helix_deg")) : plant.tool.helix;
  teeth.lag = std::tan(helix) / radius;
  return teeth;
}

std::vector<Slab> slabsOf(double corner_radius, double height, double thickness) {
  constexpr int CORNER_SLABS = 24;
  std::vector<Slab> slabs;
  double low = 0.0;
  for (int k = 0; k < CORNER_SLABS && low < std::min(corner_radius, height); ++k) {
    const double step = 0.5 * units::PI / CORNER_SLABS, lean = (k + 0.5) * step;
    Slab slab;
    slab.low = low;
    low = slab.high = corner_radius * (1.0 - std::cos((k + 1) * step));
    slab.across = std::sin(lean);
    slab.along = std::cos(lean);
    slab.length = corner_radius * step / (slab.high - slab.low);
    slab.inset = corner_radius * (1.0 - slab.across);
    slabs.push_back(slab);
  }
  for (; low < height; low += thickness) {
    Slab slab;
    slab.low = low;
    slab.high = low + thickness;
    slabs.push_back(slab);
  }
  return slabs;
}

}  // namespace smartmill::plant
