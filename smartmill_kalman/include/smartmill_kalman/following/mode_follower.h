#pragma once

#include <array>
#include <complex>
#include <optional>
#include <vector>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill::kalman {

struct ModeFollowerParameters {
  double misfit = 0.01;
  double frequency_std = 0.02;  ///< [1] by which a mode may move between two looks
  double damping_std = 0.1;     ///< [1] the same of its damping ratio
  double evidence = 30.0;       ///< [1] fall of the sum of squares that counts as a move

  void declare(ParameterTable& table) {
    table.number("misfit", misfit, "1", Range::positive(),
                 "share of the force that its model (tool, engagement, runout) does not tell");
    table.internal("frequency_std", frequency_std, "1", Range::positive());
    table.internal("damping_std", damping_std, "1", Range::positive());
    table.internal("evidence", evidence, "1", Range::positive());
  }
  /// @throws Error naming key and value.
  void validate() const;
};

/// Finds from the cut itself that the sensor's modes have moved, without a new tap.
///
/// In the steady state a free harmonic force explains any periodic record, whatever the sensor: the
/// harmonics' own innovations say nothing about it. What does is how the harmonics hang together: those of a
/// helical end mill in a known engagement follow from a few numbers (tangential and radial pressure, and one
/// edge or runout term a tooth), in x and in y alike. This force model sees the measured harmonics through
/// the sensor; its innovations drive frequency and damping of each mode, by least squares with both as
/// unknowns. A move is taken only when the innovations fall by more than evidence, and given back when the
/// first sensor explains the cut as well.
class ModeFollower {
 public:
  using Harmonics = std::array<std::vector<std::complex<double>>, 2>;  ///< x, y; n = 0..N

  /// @throws Error on an impossible tool or engagement.
  ModeFollower(const ToolGeometry& tool, const Engagement& engagement, int harmonics,
               const ModeFollowerParameters& parameters);

  struct Update {
    std::array<ModalModel, 2> sensor;  ///< as it is now
    double before = 0.0, after = 0.0;  ///< [1] sum of squares of the innovations over their variance
  };

  /// @param measured [N] harmonics of the sensor's output: output = Re sum Y_n exp(i n angle), angle of tooth
  /// 1
  /// @param noise_std [N] of their real and imaginary parts @param now the sensor as believed now
  /// @param spindle_speed [rad/s] @return nothing when the believed sensor explains them.
  std::optional<Update> update(const Harmonics& measured, double noise_std, const std::array<ModalModel, 2>& now,
                           double spindle_speed);

 private:
  ToolGeometry tool_;
  Engagement engagement_;
  int harmonics_;
  std::vector<double> radius_;  // [m] of each tooth over the first's, as found last
  ModeFollowerParameters parameters_;
  std::optional<std::array<ModalModel, 2>> first_;
};

}  // namespace smartmill::kalman
