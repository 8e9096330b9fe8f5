#pragma once

#include <array>
#include <cstdint>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_sim/world/station_traits.h"

namespace smartmill::hammer {

/// A drawn tool in a drawn machine before a hammer station.
struct DrawnStation {
  MachineModel believed;    ///< what the sequence is told
  MachineModel true_model;  ///< what stands there: the same but for how the station was set up
  sim::StationTraits traits;
  double force_scatter = 0.05;           ///< [1]
  double mounting = 0.0;                 ///< [rad] of the tool in the spindle
  std::array<double, 2> set_up{{0, 0}};  ///< [m] by which the sensors stand off where they are believed
  bool out_of_range = false;             ///< nothing stands before the sensor
  double stickout_error = 0.0;           ///< [m] of what the operator says
  double fluted_error = 0.0;             ///< [m]
  std::string direction = "x";
};

/// The machine of that number; the same arguments give the same one.
DrawnStation drawStation(std::uint64_t seed, int number);

}  // namespace smartmill::hammer
