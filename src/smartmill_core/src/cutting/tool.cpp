#include "smartmill_core/cutting/tool.h"

#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill {

double ToolGeometry::pitchOf(int k) const {
  const int tooth = ((k % teeth) + teeth) % teeth;
  return pitch.empty() ? units::TWO_PI / teeth : pitch[static_cast<std::size_t>(tooth)];
}

double ToolGeometry::toothAngle(int k) const {
  if (pitch.empty()) return units::TWO_PI * k / teeth;
  double angle = 0.0;
  for (int i = 0; i < k; ++i) angle += pitchOf(i);
  return angle;
}

double ToolGeometry::lag() const {
  return std::tan(helix) / radius();
}

double ToolGeometry::lagOf(int k) const {
  return edge.helix.empty() ? lag() : std::tan(edge.helix.at(static_cast<std::size_t>(k))) / radius();
}

double ToolGeometry::pitchAt(int k, double height) const {
  if (edge.helix.empty()) return pitchOf(k);
  const int ahead = (k + 1) % teeth;
  const double here = pitchOf(k) - (lagOf(ahead) - lagOf(k)) * height;
  if (here > 0.0) return here;
  throw Error(
      formatted("tool: helix_deg: the edges of teeth %d and %d meet %.3g mm above the tip, expected "
                "them apart over the axial depth",
                k + 1, ahead + 1, pitchOf(k) / (lagOf(ahead) - lagOf(k)) / units::MM));
}

void ToolGeometry::setHelix(const std::vector<double>& of_each_tooth) {
  edge.helix = of_each_tooth;
  double sum = 0.0;
  for (const double h : of_each_tooth) sum += std::tan(h);
  helix = std::atan(sum / static_cast<double>(of_each_tooth.size()));
}

void requireStraightEdge(const ToolGeometry& tool, const std::string& why) {
  const EdgeShape& edge = tool.edge;
  std::string stated;
  if (edge.corner_radius > 0.0) {
    stated = formatted("corner_radius_mm: %g", edge.corner_radius / units::MM);
  } else if (edge.inclined()) {
    stated = formatted("edge_angle_deg: %g", units::degFromRad(edge.edge_angle));
  } else if (edge.serrated()) {
    stated = formatted("serration: amplitude_mm: %g", edge.serration_amplitude / units::MM);
  } else if (!edge.helix.empty()) {
    stated = "helix_deg: one of each tooth";
  }
  if (!stated.empty())
    throw Error("tool: " + stated + ", expected a flat end mill with one helix angle (needed " + why + ")");
}

}  // namespace smartmill
