#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// Resolution of the contact of the teeth.
struct ContactResolution {
  int cells = 384;              ///< of a revolution: about one degree
  double slice_lag = 0.03;      ///< [rad] lag of the edge over a slice, two cells
  int wave_slices = 20;         ///< of a serration wave
  double pitch_change = 0.015;  ///< [rad] of the teeth over a slice, by a helix angle of each
  double delay_step = 0.004;    ///< [rad] of the pitch at which the delays of such a tool are taken
  int most_slices = 60;         ///< limits the time
  /// Newton's method ends after a few iterations where the contact no longer changes; a contact that
  /// alternates is ended.
  int most_iterations = 30;
  std::size_t most_breaks = 80;  ///< above, the feedback is treated as smooth
  int most_harmonics = 90;       ///< of the forced vibration: four cells in a period of the highest
};
inline constexpr ContactResolution CONTACT;

/// Forces of a contact: feedback [kind][cell] (kind 0: present motion, 1 + d: motion delayed by d) and
/// force of the rigid tool [cell].
struct ContactForces {
  std::vector<std::vector<Eigen::Matrix2d>> gain;
  std::vector<Eigen::Vector2d> force;
};

/// Forced vibration of the tool over a revolution, by harmonic balance.
class ForcedVibration {
 public:
  /// @param period [s] of a revolution
  ForcedVibration(const std::vector<SystemMode>& modes, double period) : modes_(modes), period_(period) {}

  /// Updates the vibration to that of a contact. @param delays [s] @param share [1] damping of the step, 1:
  /// full step
  void update(const ContactForces& forces, const std::vector<double>& delays, double share);

  bool empty() const { return motion_.empty(); }
  /// [m] x and y with the tool turned by an angle [rad]; zero when empty.
  Eigen::Vector2d at(double turned) const;
  /// [m] In the cells: [axis][cell].
  const std::vector<std::vector<double>>& motion() const { return motion_; }
  /// [m] The same, delayed.
  const std::vector<std::vector<double>>& delayed(std::size_t delay) const { return delayed_motion_[delay]; }

 private:
  Eigen::VectorXcd balance(const ContactForces& forces, const std::vector<double>& delays, int most) const;
  std::vector<std::vector<double>> seriesAt(double delay, int most) const;

  std::vector<SystemMode> modes_;
  double period_;
  Eigen::VectorXcd spectrum_;
  std::vector<std::vector<double>> motion_;
  std::vector<std::vector<std::vector<double>>> delayed_motion_;  // [delay][axis][cell]
};

/// Forced vibration of a stable cut with the contact of system.chip, from the modes; empty if the chips of
/// all teeth are alike. Process damping is neglected.
ForcedVibration forcedVibration(const RegenerativeSystem& system, double speed, double depth);

}  // namespace smartmill::stability
