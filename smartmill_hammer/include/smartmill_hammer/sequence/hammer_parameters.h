#pragma once

#include <cstddef>
#include <string>

#include "smartmill_core/modal/hit_test_parameters.h"

namespace smartmill::hammer {

/// Parameters of a measurement; declare() states units, bounds and meaning. The defaults are those of the
/// thesis where it gives one.
struct HammerParameters : HitTestParameters {
  // Flute search.
  double start_angle = 0.0;
  double bracket_first_step = 0.0977;
  double bracket_max_step = 0.3927;
  double flute_tolerance = 0.02618;
  double noise_sigmas = 5.0;
  double least_rise = 0.005;
  int golden_only = 0;
  // Completion of a command.
  double command_delay = 0.2;
  double settle_time = 0.05;
  double averaging_time = 0.01;
  double angle_tolerance = 2.6e-3;
  double zero_speed = 0.02;
  int rest_readings = 5;
  double position_tolerance = 2.0e-6;
  double orient_timeout = 20.0;
  double motion_timeout = 60.0;
  // Paths.
  double standoff = 5.0e-3;
  double retract_height = 50.0e-3;
  double approach_feed = 16.7e-3;
  double jog_feed = 1.0e-3;
  double near_path = 1.0e-3;
  // Sensor calibration.
  double first_jog = 50.0e-6;
  double max_jog = 100.0e-6;
  double least_jog = 5.0e-6;
  double resolution = 1.0e-6;
  double zero_volt = 0.1;
  double check_jog = 10.0e-6;
  double position_std = 0.1e-6;
  double min_gap_share = 0.5;
  double sensor_face = 8.0e-3;
  double sensor_electrode = 2.0e-3;
  double curve_error = 0.15;
  double curve_jog = 100.0e-6;
  double max_approach = 1.0e-3;
  // Hits.
  double force_high = 3000.0;
  double asked_std = 0.0;
  double exponential_time = 0.0;
  int straighten_sensor = 1;
  double averaged_share = 1.0;
  double coil_share = 0.1;
  double axes_turn_std = 0.03;
  int cross_frf = 1;
  // From the struck height to the tip.
  std::string tip_correction = "apart";
  int second_height = 1;
  double read_height = 0.0;
  double height_std = 0.5e-3;
  double stickout_std = 0.5e-3;
  std::string tool_material = "unknown";
  double tool_fluted_length = 0.0;

  // Set by programs only.
  double range_share = 0.98;     ///< [1] of the sensor's range, from which a voltage counts as its end
  int near_samples = 8;          ///< consecutive ones above it that mean that the tool is too near, not noise
  double stop_timeout = 10.0;    ///< [s] for the axes to rest after a stop: far longer than braking
  double average_timeout = 1.0;  ///< [s] for a mean voltage: a hundred times averaging_time
  int average_restarts = 3;      ///< lost or NaN samples accepted in one measurement: single losses occur
  int rest_states = 2;           ///< in a row without distance to go: it is zero between two blocks, too
  double second_search_step = 0.5;  ///< [1] of the first search's: the helix predicts where the flute is
  /// [1] of the gap at zero volt by which a flank measured at the same angle may be nearer at the second
  /// height.
  double same_flank = 0.1;
  double largest_swing = 1.5;       ///< [1] of a later hit over that of the trial hit: peaks scatter
  std::size_t least_hits = 3;       ///< of fewer hits no outlier can be identified
  std::size_t least_jackknife = 4;  ///< hits whose scatter gives a standard deviation
  double usual_flutes = 2.0,
         usual_flutes_std = 0.6;  ///< [1] fluted length in diameters where it is not given
  double longest_flutes = 0.9;    ///< [1] of the stick-out: a shank remains
  double fluted_std = 1.0e-3;     ///< [m] of a stated fluted length
  double diameter_std = 0.02e-3;  ///< [m] of a stated diameter
  /// [1] Standard deviation of the curve's gap where the approach does not determine it, of the nominal one.
  double nominal_gap_std = 0.2;
  double tilt_std =
      7.0;  ///< [1/m] wider than HolderPrior's for one height: the second one determines the tilt
  int second_height_hits = 3;         ///< least number at the second height
  double least_shank = 4e-3;          ///< [m] of tool above the hammer at the second height
  double least_lowered_share = 0.15;  ///< [1] of the hammer's offset; less does not resolve the tilt

  HammerParameters() {
    fit_low = 200.0;
    fit_high = 3500.0;
    max_modes = 6;
  }
  void declare(ParameterTable& table);
  /// @throws Error naming the key and the value that is out of range.
  void validate() const;
};

}  // namespace smartmill::hammer
