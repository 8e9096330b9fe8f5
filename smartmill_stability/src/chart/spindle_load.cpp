#include "chart/spindle_load.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartmill_core/cutting/friction.h"
#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

constexpr double NO_LIMIT = std::numeric_limits<double>::infinity();

}  // namespace

double SpindleLoad::torquePerDepth() const {
  Engagement engagement{cut_.parameters.entry, cut_.parameters.exit, 1e-3, cut_.parameters.feed_per_tooth};
  const auto row = meanForceMatrix(cut_.tool, engagement)[3];
  const double edge = std::isfinite(coefficients_.value.kte) ? coefficients_.value.kte : 0.0;
  return (row[0] * coefficients_.value.ktc + row[3] * edge) / engagement.axial_depth;
}

double SpindleLoad::friction(double speed) const {
  const bool found =
      std::isfinite(coefficients_.friction_viscous) && std::isfinite(coefficients_.friction_coulomb);
  const LinearFriction law =
      found ? LinearFriction{coefficients_.friction_viscous, coefficients_.friction_coulomb}
            : LinearFriction{cut_.spindle.viscous, cut_.spindle.coulomb};
  return std::max(0.0, law.at(speed));
}

std::array<double, 2> SpindleLoad::limits(double speed) const {
  const double per_depth = torquePerDepth(), loss = friction(speed);
  const double torque =
      cut_.spindle.rated_torque ? std::max(0.0, *cut_.spindle.rated_torque - loss) / per_depth : NO_LIMIT;
  const double power = cut_.spindle.rated_power
                           ? std::max(0.0, *cut_.spindle.rated_power / speed - loss) / per_depth
                           : NO_LIMIT;
  return {{torque, power}};
}

StabilityPoint SpindleLoad::point(double speed, double depth, double limit, double frequency) const {
  StabilityPoint result{speed, depth, limit, frequency};
  result.torque = torquePerDepth() * depth;
  result.power = result.torque * speed;
  // A tooth removes the integral of c sin(phi) R over its engagement.
  const double area = cut_.parameters.feed_per_tooth * cut_.tool.radius() *
                      (std::cos(cut_.parameters.entry) - std::cos(cut_.parameters.exit));
  result.material_removal_rate = area * depth * cut_.tool.teeth * speed / units::TWO_PI;
  return result;
}

}  // namespace smartmill::stability
