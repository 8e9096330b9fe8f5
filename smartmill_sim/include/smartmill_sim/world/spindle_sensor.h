#pragma once

#include <array>
#include <cstdint>
#include <random>
#include <vector>

#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill::sim {

/// A ring of six preloaded quartz washers in the spindle flange (Burzoni ch. 3). With a tool and holder of
/// 139 mm the defaults give the constants of his Table 3. Units and meaning: declare().
struct SpindleSensorTraits {
  bool present = false;
  double length = 0.139;
  std::array<double, 3> reach{{0.166, 0.146, 0.166}};
  std::array<double, 3> bending{{0.217, 0.195, 0.200}};
  std::array<double, 3> pair_angle{{0.995, 0.0, -0.365}};
  std::array<double, 3> mismatch{{0.002, -0.002, 0.134}};
  double axial = 0.01601;
  std::array<double, 3> preload{{6045.0, 6047.0, 6034.0}};
  double range_limit = 36e3;
  std::vector<double> x_frequency{430.0, 930.0, 1900.0}, x_damping{0.05, 0.04, 0.03};
  std::vector<double> x_share{0.30, 0.50, 0.15};
  std::vector<double> y_frequency{460.0, 1080.0, 2050.0}, y_damping{0.05, 0.04, 0.03};
  std::vector<double> y_share{0.25, 0.55, 0.15};
  std::vector<double> z_frequency{2100.0}, z_damping{0.04}, z_share{0.9};
  double reference_length = 0.139;
  double length_exponent = 0.6;
  double plane_turn = 0.03;
  double unbalance = 2.0e-5;
  double unbalance_angle = 0.7;
  double zero = 20.0;
  double drift = 0.04;
  double thermal = 15.0;
  double thermal_time = 600.0;
  double noise = 0.03;
  double noise_turning = 0.25;
  double noise_cut = 0.01;
  double bearing = 0.05;
  double bearing_order = 5.37;

  void declare(ParameterTable& table);
  /// @throws Error naming key and value.
  void validate() const;
};

/// Dynamics and output of the ring: a force on the tool tip excites the modes of spindle, holder and tool,
/// and the moment at the ring loads one washer of each pair and unloads the other. Each output is
/// proportional to (length + reach) F, linear in the length of tool and holder (its reciprocal, a calibration
/// constant, is not). Cross-talk follows from the angle between a pair and its nominal axis and from unequal
/// sensitivities of its two washers.
class SpindleSensor {
 public:
  /// @param step [s] of integration @throws Error naming key and value.
  SpindleSensor(const SpindleSensorTraits& traits, double step, double sample_rate, std::uint64_t seed);

  /// Changes tool and holder; the modes restart at rest. @param length [m] of tool and holder @throws Error
  /// if it is out of range.
  void setLength(double length);

  /// FRF of measured over applied force of an axis, for the main pair alone and unrotated principal planes.
  const ModalModel& modes(std::size_t axis) const { return modes_.at(axis); }
  /// Mean of a pair [row] over a static force along an axis [column] [1].
  std::array<std::array<double, 3>, 3> shares() const;

  /// One integration step. @param force [N] on the tool, without the unbalance @param angle [rad] of the
  /// spindle @param speed [rad/s] of the spindle
  void step(const std::array<double, 3>& force, double angle, double speed);
  /// The sample of these steps: means over them with zero, drift and noise; limited where a washer loses its
  /// compression. @return x1 .. z2 [N]
  std::array<double, 6> read();
  /// Skips a time [s].
  void skipTime(double time) { time_ += time; }

 private:
  void updateModes();

  SpindleSensorTraits traits_;
  double step_, sample_;  // [s]
  double length_;         // [m]
  std::array<ModalModel, 3> modes_;
  std::vector<ModalFilter> filters_;  // principal planes and axis
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  std::array<double, 6> zero_{}, drift_{};  // [N], [N/s]
  double time_ = 0.0, warm_ = 0.0;          // [s], [1] warming of the spindle
  std::array<double, 3> moment_sum_{};      // [N] force filtered by the modes, summed over steps
  double angle_ = 0.0, speed_ = 0.0, bearing_angle_ = 0.0;
  int steps_ = 0;
};

}  // namespace smartmill::sim
