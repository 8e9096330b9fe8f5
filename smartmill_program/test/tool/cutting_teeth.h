#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "smartmill_core/units.h"
#include "smartmill_program/tool/tooth_watch.h"

namespace smartmill::program {

/// Force of straight teeth in closed form: chip of a tooth the least over the earlier passes of n c sin(phi)
/// + difference of the radii; Ft = kt h + e, Fr = kr h + e per tooth (all in N and um).
struct CuttingTeeth {
  int teeth = 4;
  double entry = 0.0, exit = units::PI;                      // [rad]
  double feed = 80.0;                                        // [um] a tooth
  double tangential = 2.0, radial = 0.6, edge = 50.0;        // [N/um], [N/um], [N]
  std::vector<double> radius = std::vector<double>(8, 0.0);  // [um] of each tooth
  int missing = -1;
  double missing_from = 0.0;  // [rad] turned

  double radiusOf(int tooth, double turned) const {
    const double broken = tooth == missing && turned >= missing_from ? -1000.0 : 0.0;
    return radius[static_cast<std::size_t>(tooth)] + broken;
  }
  ForceSample at(double time, double turned) const {
    const double pitch = units::TWO_PI / teeth;
    ForceSample sample{time, turned, 0.0, 0.0};
    for (int j = 0; j < teeth; ++j) {
      const double phi = std::remainder(turned + j * pitch - units::PI, units::TWO_PI) + units::PI;
      if (phi < entry || phi >= exit) continue;
      double chip = 1e9;
      for (int n = 1; n <= teeth; ++n)
        chip = std::min(chip, n * feed * std::sin(phi) + radiusOf(j, turned) -
                                  radiusOf((j + n) % teeth, turned - n * pitch));
      if (chip <= 0.0) continue;
      const double ft = tangential * chip + edge, fr = radial * chip + edge;
      sample.fx += -ft * std::cos(phi) - fr * std::sin(phi);
      sample.fy += ft * std::sin(phi) - fr * std::cos(phi);
    }
    return sample;
  }
};

}  // namespace smartmill::program
