#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::kalman {

/// Compares the mean force of a sensor in steady cuts with the torque that the load meter of the spindle
/// measures: a wrong scale, sign or order of the sensor's channels, which its samples alone do not show.
///
/// Means over a revolution without edge forces (Altintas, Manufacturing Automation, 2nd ed., sec. 2.8; signs
/// as in formats.md):
///
///     Fx = -C (Ktc A + Krc B),  Fy = C (Ktc B - Krc A),  T = C Ktc S R
///     A = int sin cos,  B = int sin^2,  S = int sin over the engagement,  C = teeth x depth x feed / 2 pi
///
/// so that T = R S (B Fy - A Fx) / (A^2 + B^2) for every material, depth, feed and number of teeth. Edge
/// forces make this less than the torque, in a slot by 19 % where the tool only rubs.
class TorqueCheck {
 public:
  /// @param spindle with the full scale of its load meter
  /// @throws Error without it
  explicit TorqueCheck(const Spindle& spindle);

  /// Of the sensor's frame in the machine's, row-major; nothing is compared before.
  void setRotation(const std::array<double, 9>& rotation) { rotation_ = rotation; }

  // In the order of their stamps.
  void handle(const CuttingCondition& condition);
  void handle(const CncState& state);
  void handle(const LoadSample& sample);
  /// @param measured force on the tool in the sensor's frame @param zero [N] of the sensor
  void handle(const ForceBlock& measured, const std::array<double, 3>& zero);
  void reset();

  /// Whether force and torque disagreed when they were last compared.
  bool disagrees() const { return disagrees_; }
  /// Line about a disagreement that began since the last call, or lasts for another 5 s; empty: none.
  std::string takeLine() { return std::exchange(line_, {}); }
  /// Torque by the force over that of the load meter in the last comparison [1]; NaN: none yet
  double ratio() const { return ratio_; }

 private:
  static constexpr double NEVER = -std::numeric_limits<double>::infinity();

  /// Sums since `begin`, while the cut is steady.
  struct Window {
    double begin = NEVER;  // [s]
    std::array<double, 3> force{{0, 0, 0}};
    std::size_t samples = 0, missing = 0;
    double torque = 0.0;  // [N m]
    std::size_t readings = 0;
  };
  bool isSteadyAt(double stamp) const;
  double idleTorque() const;
  std::array<double, 2> torquesOf(const std::array<double, 3>& sensor_force) const;
  bool agrees(const std::array<double, 3>& sensor_force, double torque) const;
  const char* explanation(const std::array<double, 3>& sensor_force, double torque) const;
  void compare(double stamp);

  Spindle spindle_;
  double settle_time_;  // [s] of the load meter
  std::optional<std::array<double, 9>> rotation_;
  std::optional<CuttingCondition> condition_;
  double on_path_since_ = NEVER, at_speed_since_ = NEVER, load_stamp_ = NEVER;  // [s]; NEVER: it is not
  double measured_idle_ = 0.0,
         modelled_idle_ = 0.0;  // sums over readings in air: T_measured T_model, T_model^2
  Window window_;
  int disagreements_ = 0;  // in a row
  bool disagrees_ = false;
  double ratio_ = NOT_A_NUMBER;
  double announced_ = NEVER;  // [s]
  std::string line_;
};

}  // namespace smartmill::kalman
