#pragma once

#include <array>
#include <cstdint>
#include <random>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_sim/controller/axis_drive.h"
#include "smartmill_sim/controller/motion_state.h"

namespace smartmill::sim {

/// Motors of feed drives and spindle, with a Hall sensor at one phase of each (Cheng & Venuvinod, sections 5
/// to 9; Broms for the effect of temperature). Feed drives: synchronous motors, current proportional to
/// force. Spindle: an induction motor with a magnetising current and constant power above its base speed.
/// Units and meaning: declare().
struct MotorTraits {
  bool currents = false;
  std::array<double, 3> mass{{400.0, 400.0, 400.0}};
  std::array<double, 3> coulomb{{150.0, 150.0, 150.0}};
  std::array<double, 3> viscous{{600.0, 600.0, 600.0}};
  std::array<double, 3> stribeck{{60.0, 60.0, 60.0}};
  double stribeck_velocity = 2.0e-3;
  std::array<double, 3> weight{{0.0, 0.0, 0.0}};
  std::array<double, 3> disturbance{{15.0, 15.0, 15.0}};
  std::array<double, 3> disturbance_period{{0.01, 0.01, 0.01}};
  std::array<double, 3> newton_per_ampere{{200.0, 200.0, 216.0}};
  std::array<double, 3> phase_per_metre{{400.0, 400.0, 400.0}};
  double spindle_torque_per_ampere = 1.2;
  double spindle_magnetising = 6.0;
  double spindle_base_speed = 165.0;
  double spindle_phase_per_revolution = 2.0;
  double spindle_slip = 5.0e-4;
  double bandwidth = 60.0;
  double temperature = 20.0;
  double warm_up = 0.02;
  double warm_up_time = 1500.0;
  double friction_per_kelvin = 0.008;
  double gain_per_kelvin = 0.0011;
  double harmonic = 0.03;
  double noise = 0.03;

  void declare(ParameterTable& table);
  std::array<AxisDrive, 3> drives() const;
};

/// Phase currents of the motors at 1 kHz: a sine over the electrical angle, whose range (twice the amplitude)
/// follows the motor's load. At rest static friction carries the load up to its limit, and the
/// current is constant.
class MotorCurrents {
 public:
  static constexpr double SAMPLE_RATE = 1000.0;  ///< [Hz]

  MotorCurrents(const MotorTraits& traits, const Spindle& spindle, std::uint64_t seed);

  struct Input {
    double time = 0.0;  ///< [s]
    MotionState motion;
    std::array<double, 3> force{{0, 0, 0}};  ///< [N] cutting force on the tool
    double torque = 0.0;                     ///< [N m] cutting torque
  };
  /// Inputs at several times SAMPLE_RATE; loads are means between samples.
  void push(const Input& input);

  /// Samples since the last call: channels x, y, z, spindle [A].
  SampleBlock take();

  /// Range [A] of the spindle current under a torque [N m] at a speed [rad/s].
  double spindleRange(double torque, double speed) const;
  double temperature() const { return temperature_; }  ///< [deg C] present temperature of the drives

 private:
  struct DriveState {
    double time = 0.0;
    std::array<double, 3> position{{0, 0, 0}};
    double turns = 0.0;  // [1] of the spindle
    double speed = 0.0;  // [rad/s]
  };
  void sample(const DriveState& at);
  double phase(double range, double periods);

  MotorTraits traits_;
  std::array<AxisDrive, 3> drives_;
  Spindle spindle_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  bool started_ = false;
  DriveState last_, sampled_;
  double last_angle_ = 0.0;
  std::array<double, 3> cut_{{0, 0, 0}}, load_{{0, 0, 0}}, velocity_{{0, 0, 0}};
  double torque_ = 0.0, torque_load_ = 0.0, slip_revolutions_ = 0.0, count_ = 0.0;
  double temperature_;
  std::uint64_t index_ = 0, block_index_ = 0;
  std::vector<double> samples_;
};

}  // namespace smartmill::sim
