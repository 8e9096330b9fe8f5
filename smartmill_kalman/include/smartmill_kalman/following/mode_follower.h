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
  double frequency_std = 0.02;  ///< [1] standard deviation of a mode's shift between two updates
  double damping_std = 0.1;     ///< [1] relative, of its damping ratio
  double evidence = 30.0;       ///< [1] decrease of the sum of squares that proves a shift
  double radius_std = 20.0;     ///< [um] prior of a tooth's radius: the runout of a usual holder

  // Search of a mode that is missing in the taps.
  double hidden_low = 300.0;     ///< [Hz] lowest frequency; force sensors have their modes above
  double hidden_step = 1.02;     ///< [1] from frequency to frequency, within the width of a mode
  double hidden_damping = 0.03;  ///< [1] initial damping ratio
  double gain_std = 0.05;        ///< [1] prior of its gain; a larger one would be seen in the taps
  double wider = 5.0;  ///< [1] factor on the prior of its frequency and damping, which are not tapped
  double hidden_evidence = 2.0;  ///< [1] required evidence over that of a shift
  double unexplained = 2.0;      ///< [1] mean square of the innovations above which a mode may be missing
  /// [1] Largest cost with that mode over the cost without. A wrong force model (helix, depth, exit) leaves a
  /// third of the cost or more.
  double max_cost_ratio = 0.25;
  int min_redundancy = 12;  ///< rows in addition to the unknowns; fewer fit any mode

  void declare(ParameterTable& table) {
    table.number("misfit", misfit, "1", Range::positive(),
                 "relative error of the force model (tool, engagement, runout)");
    table.internal("frequency_std", frequency_std, "1", Range::positive());
    table.internal("damping_std", damping_std, "1", Range::positive());
    table.internal("evidence", evidence, "1", Range::positive());
  }
  /// @throws Error naming key and value.
  void validate() const;
};

/// Estimates shifts of the sensor's modes from the cutting force, without a new tap.
///
/// In the steady state free harmonics fit any periodic record with any sensor model, so their innovations do
/// not depend on it. The relation between the harmonics does: for a helical end mill in a known engagement
/// they follow from a few numbers (tangential and radial pressure, chip and edge, and the radius of each
/// tooth), in x and y. Frequency and damping of each mode are fitted by least squares so that this force
/// model, passed through the sensor, explains the measured harmonics. A shift is accepted when the sum of
/// squares falls by more than `evidence`, and withdrawn when the tapped sensor explains the cut as well.
class ModeFollower {
 public:
  using Harmonics = std::array<std::vector<std::complex<double>>, 2>;  ///< x, y; n = 0..N

  /// @throws Error on an impossible tool or engagement.
  ModeFollower(const ToolGeometry& tool, const Engagement& engagement, int harmonics,
               const ModeFollowerParameters& parameters);

  struct Update {
    std::array<ModalModel, 2> sensor;  ///< shifted
    double before = 0.0, after = 0.0;  ///< [1] sum of squares of the innovations over their variance
  };

  /// @param measured [N] harmonics of the sensor's output: output = Re sum Y_n exp(i n angle), angle of tooth
  /// 1
  /// @param noise_std [N] of their real and imaginary parts @param now the sensor in use
  /// @param spindle_speed [rad/s] @return nothing when the sensor in use explains them.
  std::optional<Update> update(const Harmonics& measured, double noise_std,
                               const std::array<ModalModel, 2>& now, double spindle_speed);

 private:
  ToolGeometry tool_;
  Engagement engagement_;
  int harmonics_;
  std::vector<double> radius_;  // [m] of each tooth relative to the first, last estimate
  ModeFollowerParameters parameters_;
  std::optional<std::array<ModalModel, 2>> first_;
};

}  // namespace smartmill::kalman
