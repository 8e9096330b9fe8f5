#include "smartmill_core/modal/state_space.h"

#include <cmath>

#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/units.h"

namespace smartmill {

StateSpace stateSpace(const ModalModel& model) {
  const auto states = static_cast<Eigen::Index>(2 * model.modes.size());
  StateSpace system{Eigen::MatrixXd::Zero(states, states), Eigen::MatrixXd::Zero(states, 1),
                    Eigen::MatrixXd::Zero(1, states), Eigen::MatrixXd::Constant(1, 1, model.direct)};
  for (Eigen::Index k = 0; k < states; k += 2) {
    const Mode& mode = model.modes[static_cast<std::size_t>(k / 2)];
    const double w = units::TWO_PI * mode.frequency;
    // Eq. 5.20 with its first state divided by w.
    system.a.block<2, 2>(k, k) << 0.0, -w, w, -2.0 * mode.damping_ratio * w;
    system.b(k, 0) = mode.gain * w;
    system.c(0, k + 1) = 1.0;
  }
  return system;
}

std::pair<Eigen::MatrixXd, Eigen::MatrixXd> discretiseNoise(const Eigen::MatrixXd& a,
                                                            const Eigen::MatrixXd& q, double dt) {
  const Eigen::Index n = a.rows();
  // exp(-A dt) grows where exp(A dt) decays; doubling from a short step avoids the loss of digits.
  int doublings = 0;
  double step = dt;
  while (a.size() > 0 && a.cwiseAbs().rowwise().sum().maxCoeff() * std::abs(step) > 0.5) {
    step *= 0.5;
    ++doublings;
  }
  Eigen::MatrixXd joint = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  joint.topLeftCorner(n, n) = -a * step;
  joint.topRightCorner(n, n) = q * step;
  joint.bottomRightCorner(n, n) = a.transpose() * step;
  const Eigen::MatrixXd exponential = linear::exponential(joint);
  Eigen::MatrixXd phi = exponential.bottomRightCorner(n, n).transpose();
  Eigen::MatrixXd noise = phi * exponential.topRightCorner(n, n);
  for (int i = 0; i < doublings; ++i) {
    noise += (phi * noise * phi.transpose()).eval();
    phi = (phi * phi).eval();
  }
  noise = (0.5 * (noise + noise.transpose())).eval();
  return {phi, noise};
}

}  // namespace smartmill
