#include "smartmill_sim/controller/axis_drive.h"

#include <cmath>

#include "smartmill_core/cutting/friction.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {

double AxisDrive::friction(double velocity, double factor) const {
  if (velocity == 0.0) return 0.0;
  const double speed = std::abs(velocity);
  const double dry = coulomb + stribeckFriction(stribeck, stribeck_velocity, speed);
  return std::copysign(LinearFriction{viscous, dry}.at(speed, 0.0, factor), velocity);
}

double AxisDrive::force(double position, double velocity, double acceleration, double cut,
                        double friction_factor) const {
  const double turned = units::TWO_PI * position / disturbance_period;
  return mass * acceleration + friction(velocity, friction_factor) + weight + disturbance * std::sin(turned) -
         cut;
}

}  // namespace smartmill::sim
