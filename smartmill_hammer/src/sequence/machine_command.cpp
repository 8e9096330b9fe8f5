#include "smartmill_hammer/sequence/machine_command.h"

#include <cmath>

#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::hammer {

std::string moveProgram(const Axes3& from, const std::vector<Waypoint>& path) {
  std::string text = "G91\n";
  Axes3 position = from;
  for (const Waypoint& w : path) {
    std::string block = w.feed > 0.0 ? "G1" : "G0";
    bool moves = false;
    for (std::size_t i = 0; i < 3; ++i) {
      const double distance = (w.position[i] - position[i]) / units::MM;
      if (std::abs(distance) < 0.5e-4) continue;
      block += formatted(" %c%.4f", "XYZ"[i], distance);
      moves = true;
    }
    position = w.position;
    if (!moves) continue;
    if (w.feed > 0.0) block += formatted(" F%.1f", w.feed / units::MM * 60.0);
    text += block + "\n";
  }
  return text + "G90\n";
}

}  // namespace smartmill::hammer
