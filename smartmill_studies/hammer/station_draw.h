#pragma once

#include <array>
#include <cstdint>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_sim/world/station_traits.h"

namespace smartmill::hammer {

/// A random tool in a random machine at a hammer station.
struct DrawnStation {
  MachineModel believed;    ///< as passed to the sequence
  MachineModel true_model;  ///< the true one; it differs by the errors of the station's set-up
  sim::StationTraits traits;
  double force_scatter = 0.05;           ///< [1]
  double mounting = 0.0;                 ///< [rad] of the tool in the spindle
  std::array<double, 2> set_up{{0, 0}};  ///< [m] error of the stated position of the sensors
  bool out_of_range = false;             ///< nothing is in front of the sensor
  double stickout_error = 0.0;           ///< [m] of the operator's value
  double fluted_error = 0.0;             ///< [m]
  std::string direction = "x";
};

/// The machine with a number; the same arguments give the same machine.
DrawnStation drawStation(std::uint64_t seed, int number);

/// The same with the sensor opposite the hammer, at its height: an odd number of teeth becomes the next even
/// one, teeth are evenly spaced.
DrawnStation withSensorOpposite(DrawnStation drawn);

}  // namespace smartmill::hammer
