#pragma once

#include "smartmill_core/cutting/mechanistic.h"

namespace smartmill::loadmeter {

/// Mean torque of a cut per unit of the coefficients that determine it (eq. 3.14, 3.19 for any engagement).
struct TorqueSensitivity {
  double tc = 0.0;  ///< [N m] per N/m2 of Ktc
  double te = 0.0;  ///< [N m] per N/m of Kte

  double torque(double ktc, double kte) const { return tc * ktc + te * kte; }  ///< [N m]
};

/// @throws Error on an invalid tool or engagement.
inline TorqueSensitivity torqueSensitivity(const ToolGeometry& tool, const Engagement& engagement) {
  const auto map = meanForceMatrix(tool, engagement);
  return {map[3][0], map[3][3]};
}

}  // namespace smartmill::loadmeter
