#pragma once

#include <string>
#include <vector>

#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill::sim {

/// Properties of a hammer station beyond the model's `hammer` section: bending of the tool between hammer,
/// sensor and tip, the sensor's electrode, and imperfections of the solenoid. The defaults are an ideal
/// station: a point sensor, half-sine pulses and the model's modes with a rigid tool. Units and meaning:
/// declare().
struct StationTraits {
  std::string structure = "modes";
  double pivot = 0.25;
  // The tool as a beam.
  double shank_diameter = 0.0;
  double flute_length = 25.0e-3;
  double flute_core = 0.8;
  double young = 5.8e11;
  double density = 14500.0;
  double tool_damping = 0.004;
  // Spindle and holder at the holder's face, and the joint.
  std::vector<double> spindle_frequency{620.0, 1050.0, 1900.0};
  std::vector<double> spindle_damping{0.035, 0.03, 0.025};
  std::vector<double> spindle_stiffness{1.6e8, 1.2e8, 2.5e8};
  std::vector<double> spindle_slope{4.0, 7.0, -9.0};
  double joint_stiffness = 2.0e8;
  double joint_rotation = 6.0e4;
  double joint_damping = 0.03;
  double plane_ratio = 1.0;
  double plane_turn = 0.0;
  // The sensor.
  double read_height = 0.0;
  double electrode = 0.0;
  double housing = 0.0;
  double beside = 0.0;
  double gain_error = 0.0;
  double bend = 0.0;
  bool cross_sensor = false;
  // The tool's surface.
  std::string tooth = "flute";
  double rake_flank = 0.25;
  double relief_flank = 0.35;
  double land = 0.0;
  std::vector<double> tooth_low;
  double eccentricity = 0.0;
  double eccentricity_angle = 0.0;
  // The solenoid.
  double pulse_skew = 0.0;
  double pulse_scatter = 0.0;
  double contact_scatter = 0.0;
  double bounce_chance = 0.0;
  double bounce_share = 0.3;
  double bounce_delay = 2.0e-3;
  double coil_time = 3.0e-3;
  double coil_force = 0.0;
  double coil_volt = 0.0;
  double axis_scatter = 0.0;

  // Set by programs only.
  // Distances of a position within which the tool counts as in front of a sensor.
  double lateral_reach = 2e-3;    ///< [m]
  double vertical_reach = 30e-3;  ///< [m] includes the second height and the flute search
  double axial_reach = 4e-3;      ///< [m] far beyond the range of the sensor
  double rest_speed = 0.02;       ///< [rad/s] a hammer hits only a tool that is at rest
  int surface_update = 32;        ///< [samples] between two updates of a moving surface: 1.25 ms
  double decay_time = 2.0;        ///< [s] after a hit, in which the least damped mode decays
  double highest = 16000.0;       ///< [Hz] limit of the retained modes, above half the sample rate
  int electrode_across = 9, electrode_along = 5;  ///< spots of the mean over the electrode
  int housing_spots = 10;  ///< on the radius of the housing, for the least distance of the tool

  void declare(ParameterTable& table);
  /// Bounds and consistency of the lists. @throws Error naming key and value.
  void validate() const;
};

}  // namespace smartmill::sim
