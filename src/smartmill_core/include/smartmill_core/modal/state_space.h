#pragma once

#include <utility>

#include <Eigen/Core>

#include "smartmill_core/modal/modal_model.h"

namespace smartmill {

/// x' = A x + B u, y = C x + D u.
struct StateSpace {
  Eigen::MatrixXd a, b, c, d;
};

/// Observable form per mode (Dunwoody eq. 5.18..5.23): two states per mode, one input, one output. Well
/// conditioned for any number of modes: states are scaled by the natural frequency, so that the entries of A
/// have one magnitude per mode.
StateSpace stateSpace(const ModalModel& model);

/// Exact discrete transition and process noise covariance (Van Loan) of x' = A x + w, E w w' = q.
/// @return {phi, qd} for a step dt [s].
std::pair<Eigen::MatrixXd, Eigen::MatrixXd> discretiseNoise(const Eigen::MatrixXd& a,
                                                            const Eigen::MatrixXd& q, double dt);

}  // namespace smartmill
