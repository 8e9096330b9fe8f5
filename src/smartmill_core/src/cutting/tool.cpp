#include "smartmill_core/cutting/tool.h"

#include <cmath>

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

}  // namespace smartmill
