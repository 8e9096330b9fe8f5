#pragma once

#include <string>
#include <vector>

#include "stability/turning_loop.h"

namespace smartmill::stability {

/// Kim's machine without control, with the control of this package and with his update as printed and
/// corrected, and his figures 4 to 7 of them.
struct KimFigures {
  SecondOrder truth{0.1, 350.0, 0.02};
  TurningTrace free, ours;
  KimRun printed, corrected;
  std::vector<std::string> pictures;
};
/// @param growth logarithm of the free vibration's growth over a segment of 2.048 s @param folder of the
/// pictures @throws Error
KimFigures kimFigures(double growth, const std::string& folder);

/// [m] rms of the last half second.
double lastVibration(const TurningTrace& trace);

}  // namespace smartmill::stability
