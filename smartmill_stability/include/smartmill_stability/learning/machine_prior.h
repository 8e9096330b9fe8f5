#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// A positive quantity whose logarithm is normal.
struct LogNormal {
  double median = 0.0;   ///< > 0
  double log_std = 0.0;  ///< [1] >= 0 standard deviation of the natural logarithm
  /// @param normal [1] standard normal coordinate
  double at(double normal) const;
};

/// What is known of one mode before the first cut.
struct ModePrior {
  LogNormal frequency;  ///< [Hz]
  LogNormal damping;    ///< [1] damping ratio
  LogNormal stiffness;  ///< [N/m] > 0
  /// The mode to which frequency and stiffness are relative, as an index of the same direction; -1: none.
  int relative_to = -1;
};

/// What is known of tool and material before the first cut: independent standard normal coordinates, which
/// machine() maps to a machine. Steps of a Markov chain in these coordinates need no other density.
struct MachinePrior {
  RegenerativeSystem cut;  ///< teeth, pitch, helix, diameter, arc; its modes and coefficients are not used
  std::array<std::vector<ModePrior>, 2> modes;  ///< along x and y
  /// [1] Correlation of the coordinates of the same mode in x and y (the same bending of a round tool in two
  /// directions); 0 with different numbers of modes.
  double alike_frequency = 0.0, alike_damping = 0.0, alike_stiffness = 0.0;
  LogNormal kt;            ///< [N/m2]
  LogNormal radial_ratio;  ///< [1] kr / kt

  /// Of an end mill of which only teeth, helix and diameter are known, in metal: two modes in each direction;
  /// the first one at 1.2 kHz within a factor of 1.9, 20 N/um within 2.2, damping ratio 0.03 within 1.6, the
  /// second one at 1.2 to 2.7 times the frequency; kt 1.2 kN/mm2 within 1.6, kr / kt 0.35 within 1.5 (one
  /// standard deviation each); modes of y near those of x.
  static MachinePrior wide(const RegenerativeSystem& cut);
  /// About the modes of a model, for example of receptance coupling, with their standard deviations (those it
  /// lacks: `uncertainty_percent`), and about its coefficients if it states them, else wide.
  /// @throws Error when the model lacks modes of x or y.
  static MachinePrior about(const MachineModel& model, const RegenerativeSystem& cut);

  std::size_t coordinates() const;
  /// @param at standard normal coordinates, as many as coordinates()
  RegenerativeSystem machine(const std::vector<double>& at) const;
  /// @throws Error naming quantity and value.
  void validate() const;
};

}  // namespace smartmill::stability
