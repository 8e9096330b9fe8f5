#pragma once

#include <complex>
#include <string>
#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/modal/state_space.h"

namespace smartmill::kalman {

/// Burzoni 4.4: whether a state space can carry a Kalman filter.
struct StateSpaceCheck {
  std::string form;  ///< which coordinates
  int states = 0;
  double condition = 0.0;    ///< [1] |A| |A^-1| in the infinity norm (eq. 4-38)
  bool conditioned = false;  ///< 1 / condition above the machine's precision (eq. 4-37)
  bool stable = false;       ///< every pole left of the imaginary axis (on it for an integrator of the force)
  double slowest = 0.0;      ///< [1/s] largest real part of a pole
  int rank = 0;              ///< of the observability matrix (eq. 4-40)
  double observability_condition = 0.0;  ///< [1] of the observability matrix (eq. 4-42)
  bool observable = false;               ///< full rank and conditioned
  /// [1] smallest singular value of [(A - p) / |A|; C / |C|] over all poles p (Hautus): observability without
  /// the powers of A of eq. 4-40
  double margin = 0.0;
};

/// @param space as it is used @param time [s] the unit of time in which A is counted (1: seconds): powers of
/// A in eq. 4-40 are those of numbers of size 1 when it is that of the modes
StateSpaceCheck checkStateSpace(const StateSpace& space, const std::string& form, double time = 1.0);

/// Observable canonical form from the polynomials (eq. 4-29..4-34), as Burzoni builds it.
StateSpace companionForm(const ModalModel& model);
/// With the applied force as one more state (eq. 4-43): 2 k + 1 states.
StateSpace withForce(const StateSpace& space);

/// Balanced coordinates: both Gramians the same diagonal matrix of Hankel singular values.
struct Balanced {
  StateSpace space;
  std::vector<double> hankel;  ///< [unit of the model] falling, all of them
  double bound = 0.0;  ///< [unit] twice the sum of those left out: largest error of the response anywhere
};
/// Balanced truncation of a stable state space with one input and one output. @param states to keep; 0: all.
/// @throws Error when it is not stable or states is out of range.
Balanced balance(const StateSpace& space, int states = 0);
/// As many states as keep bound below tolerance x largest Hankel value.
Balanced balanceTo(const StateSpace& space, double tolerance);

/// Response of a state space at f [Hz].
std::complex<double> responseOf(const StateSpace& space, double f);

/// The forms of one sensor axis side by side: companion, modal, modal in the modes' unit of time, balanced,
/// and the last with the force as a state.
std::vector<StateSpaceCheck> checkSensor(const ModalModel& sensor);

}  // namespace smartmill::kalman
