#pragma once

#include <string>
#include <vector>

#include "smartmill_core/cutting/force_curve.h"
#include "smartmill_core/modal/modal_model.h"

namespace smartmill::kalman {

/// A tool with one mode in continuous cut (Bachrathy and Stepan's reference 9): x'' + 2 zeta w x' + w^2
/// x = (w^2 / k) b F(h), chip thickness h from the tool's position to the lowest surface of all earlier cuts,
/// 0 in air.
struct BistablePoint {
  double speed = 0.0;  ///< [rad/s]
  double small = 0.0;  ///< [m] depth from which the smallest vibration grows
  double large = 0.0;  ///< [m] depth from which a large one persists; below `small` in a bistable zone
};

/// @param mode of the tool tip, gain [m/N] @param feed [m] per tooth @param kick [1] large initial vibration
/// over feed
/// @param deepest [m] largest depth of the search @return one point per speed
std::vector<BistablePoint> bistableRange(const ForceCurve& law, const Mode& mode, int teeth, double feed,
                                         const std::vector<double>& speeds, double kick, double deepest);

/// Draws the range with gnuplot. @throws Error.
void drawBistable(const std::vector<BistablePoint>& points, const std::string& png);

}  // namespace smartmill::kalman
