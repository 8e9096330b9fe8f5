#pragma once

#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_hammer/sequence/hammer_parameters.h"
#include "smartmill_hammer/sequence/machine_command.h"

namespace smartmill::hammer {

/// @param value rounded to a multiple of this step
double roundTo(double value, double step);

/// Paths to the hammer station of a direction, at its second height, and away from it. All in
/// positions [m] along the axes of the station (StationAxes).
class StationPaths {
 public:
  /// @param direction "x" or "y", for which the model's hammer station has a position
  StationPaths(const HammerParameters& parameters, const MachineModel& model, const std::string& direction);

  const Axes3& station() const { return station_; }
  std::size_t along() const { return along_; }       ///< axis towards the sensor
  std::size_t across() const { return 1 - along_; }  ///< axis towards the second sensor

  std::vector<Waypoint> approach(const Axes3& here) const;
  /// First sideways to the station's distance, at which no part of the tool can reach the sensor; then down.
  std::vector<Waypoint> toSecondHeight(const Axes3& here, double lowered) const;
  /// Moves away from the sensors only, never towards them.
  std::vector<Waypoint> retract(const Axes3& here) const;

 private:
  const HammerParameters& parameters_;
  Axes3 station_;
  std::size_t along_;
  double safe_height_;  // [m]
};

}  // namespace smartmill::hammer
