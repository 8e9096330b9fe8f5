#pragma once

#include "smartmill_core/model/machine_model.h"

namespace smartmill {

/// Axes x and y of the hammer station, along which its sensors and its hits are: those of the machine turned
/// about z by the angle of frames.hammer. z is the machine's. Places of the station are those of
/// hammer.position_mm.
class StationAxes {
 public:
  StationAxes() = default;  ///< aligned
  /// @throws Error when the model's frames.hammer is tilted.
  explicit StationAxes(const MachineModel& model);

  double angle() const { return angle_; }  ///< [rad] from the machine's x to the station's
  bool isTurned() const { return angle_ != 0.0; }
  Axes3 toStation(const Axes3& v) const { return turned(v, -sin_); }
  Axes3 toMachine(const Axes3& v) const { return turned(v, sin_); }

 private:
  Axes3 turned(const Axes3& v, double sin) const;

  double angle_ = 0.0, cos_ = 1.0, sin_ = 0.0;
};

}  // namespace smartmill
