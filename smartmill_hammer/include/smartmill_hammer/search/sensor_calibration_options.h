#pragma once

#include <cstddef>

namespace smartmill::hammer {

/// Calibration of the displacement sensor in the machine (Dunwoody section 4.2). All distances [m] are
/// positive towards the sensor.
struct SensorCalibrationOptions {
  double first_jog = 50e-6;   ///< [m] > 0
  double max_jog = 100e-6;    ///< [m] >= first_jog
  double least_jog = 5e-6;    ///< [m] > 0; below this the machine's resolution dominates the sensitivity
  double resolution = 1e-6;   ///< [m] of a commanded distance
  double zero_volt = 0.1;     ///< [V] magnitude below which the sensor is zeroed
  double check_jog = 10e-6;   ///< [m] half width of the final, symmetric measurement about zero; 0: the
                              ///< sensitivity of the last approach jog is used, as in the thesis
  double curve_jog = 100e-6;  ///< [m] away from the sensor, where the curvature is measured at the end, and
                              ///< halfway; 0: from the samples of the approach alone
  double position_std = 0.1e-6;      ///< [m] of a distance moved (thesis: within 100 nm)
  double range_volt = 10.0;          ///< [V] the sensor saturates at plus and minus this
  double gain_volt = 10.0;           ///< [V] nominal curve V = gain_volt (gap_at_zero_volt / gap - 1)
  double gap_at_zero_volt = 250e-6;  ///< [m]
  double min_gap = 100e-6;           ///< [m] no jog to a nominal gap below this
  double swing = 0.0;  ///< [m] towards the sensor that a hit may cause; added to min_gap before a sharp edge
  double max_travel = 3e-3;   ///< [m] longest approach
  double safe_travel = 1.0;   ///< [m] without contact; the approach ends there
  double largest_std = 0.02;  ///< [1] relative, of the sensitivity where the approach ended early
  int max_jogs = 100;         ///< [1]

  double range_share = 0.95;       ///< [1] of the range, from which a voltage does not depend on the distance
  double least_reach = 0.2;        ///< [1] least span of the samples over the required one
  int curve_rounds = 4;            ///< iterations of that span by the gap found, which converges in fewer
  double curve_reach = 1.2;        ///< [1] range of samples over `curve_jog` that determine the curvature
  std::size_t least_readings = 5;  ///< of a curve with three unknowns
  double known_far = 0.01;  ///< [1] standard deviation of the far voltage over the gain: more is undetermined
  double least_slope = 10e-6;  ///< [m] shortest jog whose slope gives the gap; noise hides shorter ones
  double clear_rise = 1.05;    ///< [1] least ratio of the slopes of two such jogs
  double sharp = 0.8;          ///< [1] local over nominal gap: below it an edge sharper than the electrode
                               ///< faces the sensor
  double least_bend = 0.08, most_bend = 4.0;  ///< [1] valid gaps of the curve over the nominal gap
};

}  // namespace smartmill::hammer
