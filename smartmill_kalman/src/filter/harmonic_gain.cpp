#include "smartmill_kalman/filter/harmonic_gain.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include <Eigen/Core>

#include "smartmill_core/modal/state_space.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/filter/riccati.h"

namespace smartmill::kalman {

HarmonicGain designHarmonicGain(const HarmonicDesign& design) {
  const std::optional<HarmonicGain> gain = spectralGain(design);
  return gain ? *gain : riccatiGain(design);
}

int harmonicCount(double top, double revolution, int most) {
  return std::clamp(static_cast<int>(top * revolution), 1, most);
}

double harmonicSettling(const ModalModel& sensor, double f, double settling, double quickest) {
  return std::max(std::min(1.0, 2.0 * std::abs(sensor.response(f))) * settling, quickest);
}

HarmonicGain designHarmonicGain(const ModalModel& sensor, double spindle_speed, double sample_rate,
                                int harmonics, double noise_rms, double settling, double quickest) {
  HarmonicDesign design{sensor, spindle_speed, sample_rate, noise_rms, {}};
  for (int n = 0; n <= harmonics; ++n) {
    design.settling.push_back(
        harmonicSettling(sensor, n * spindle_speed / units::TWO_PI, settling, quickest));
  }
  return designHarmonicGain(design);
}

HarmonicGain riccatiGain(const HarmonicDesign& design) {
  const auto harmonics = static_cast<Eigen::Index>(design.settling.size()) - 1;
  const auto m = static_cast<Eigen::Index>(2 * design.sensor.modes.size());
  const Eigen::Index f = 2 * harmonics + 1;
  const double dt = 1.0 / design.sample_rate;
  const double r = design.noise_rms * design.noise_rms;

  // Eq. 5.37: z = (sensor states, force states). The harmonics do not drive each other: each is discretised
  // with the modes alone, which is the same at a fraction of the cost.
  const StateSpace modes = stateSpace(design.sensor);
  Eigen::RowVectorXd force = Eigen::RowVectorXd::Zero(f);
  Eigen::MatrixXd phi = Eigen::MatrixXd::Zero(m + f, m + f), noise = phi;
  for (Eigen::Index n = 0; n <= harmonics; ++n) {
    const Eigen::Index own = n == 0 ? 1 : 2, at = m + (n == 0 ? 0 : 2 * n - 1);
    const double w = static_cast<double>(n) * design.spindle_speed;
    const double tau = design.settling[static_cast<std::size_t>(n)];
    Eigen::MatrixXd a = Eigen::MatrixXd::Zero(m + own, m + own), q = a;
    a.topLeftCorner(m, m) = modes.a;
    a.block(0, m, m, 1) = modes.b;
    if (n > 0) {
      a(m, m + 1) = w;
      a(m + 1, m) = -w;
    }
    q.diagonal().tail(own).setConstant(r * dt / (tau * tau));
    force(at - m) = 1.0;
    const auto [phi_n, noise_n] = discretiseNoise(a, q, dt);
    phi.topLeftCorner(m, m) = phi_n.topLeftCorner(m, m);
    phi.block(0, at, m, own) = phi_n.topRightCorner(m, own);
    phi.block(at, at, own, own) = phi_n.bottomRightCorner(own, own);
    noise.topLeftCorner(m, m) += noise_n.topLeftCorner(m, m);
    noise.block(0, at, m, own) = noise_n.topRightCorner(m, own);
    noise.block(at, 0, own, m) = noise_n.bottomLeftCorner(own, m);
    noise.block(at, at, own, own) = noise_n.bottomRightCorner(own, own);
  }
  Eigen::RowVectorXd c(m + f), d(m + f);
  c << modes.c, design.sensor.direct * force;
  d << Eigen::RowVectorXd::Zero(m), force;

  const StationaryGain found = stationaryGain(phi, noise, c, r);
  const Eigen::VectorXd smoothing = found.covariance * d.transpose();
  HarmonicGain gain;
  gain.variance = found.variance;
  gain.filter.assign(found.gain.data(), found.gain.data() + found.gain.size());
  gain.smoothing.assign(smoothing.data(), smoothing.data() + smoothing.size());
  return gain;
}

}  // namespace smartmill::kalman
