#include "smartmill_core/model/station_axes.h"

#include <array>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/frames.h"
#include "smartmill_core/units.h"

namespace smartmill {

StationAxes::StationAxes(const MachineModel& model) {
  const PlacedFrame frame = placedFrame(model.frames, frames::HAMMER, frames::MACHINE);
  if (!frame.isTurned()) return;
  const std::array<double, 9>& r = frame.rotation;
  constexpr double LEVEL = 1e-6;  // [1] sine of a tilt that is a rounding error of the file
  if (std::hypot(r[2], r[5]) > LEVEL || r[8] < 0.0) {
    throw Error(model.file + ": frames.hammer is tilted by " +
                formatted("%.2f deg", units::degFromRad(std::atan2(std::hypot(r[2], r[5]), r[8]))) +
                ", expected a station turned about z alone");
  }
  angle_ = std::atan2(r[3], r[0]);
  cos_ = std::cos(angle_);
  sin_ = std::sin(angle_);
}

Axes3 StationAxes::turned(const Axes3& v, double sin) const {
  return {cos_ * v[0] - sin * v[1], sin * v[0] + cos_ * v[1], v[2]};
}

}  // namespace smartmill
