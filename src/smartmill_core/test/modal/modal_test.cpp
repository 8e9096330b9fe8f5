#include <cmath>
#include <complex>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/modal/state_space.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

using Complex = std::complex<double>;
using units::TWO_PI;

constexpr double RATE = 25600.0;

ModalModel model() {
  ModalModel m;
  m.modes = {{12.0, 0.05, 0.3}, {930.0, 0.03, 0.5}, {4100.0, 0.01, -0.1}};
  m.direct = 0.3;
  return m;
}

// Response of one mode of unit gain to a unit step after t [s].
double stepResponse(const Mode& mode, double t) {
  const double w = TWO_PI * mode.frequency, z = mode.damping_ratio, root = std::sqrt(1.0 - z * z);
  return 1.0 - std::exp(-z * w * t) * (std::cos(w * root * t) + z / root * std::sin(w * root * t));
}

// Its integral: the response to a ramp of slope one.
double rampResponse(const Mode& mode, double t) {
  const double w = TWO_PI * mode.frequency, z = mode.damping_ratio, root = std::sqrt(1.0 - z * z);
  const double decay = std::exp(-z * w * t);
  return t - 2.0 * z / w +
         decay / w * (2.0 * z * std::cos(w * root * t) + (2.0 * z * z - 1.0) / root * std::sin(w * root * t));
}

TEST(ModalModel, responseOfOneMode) {
  const Mode mode{100.0, 0.02, 3.0};
  EXPECT_DOUBLE_EQ(mode.response(0.0).real(), 3.0);
  // At the natural frequency gain / (2 i zeta).
  EXPECT_NEAR(std::abs(mode.response(100.0) - Complex(0.0, -75.0)), 0.0, 1e-12);
  const double wn = TWO_PI * 100.0, w = TWO_PI * 130.0;
  const Complex expected = 3.0 * wn * wn / Complex(wn * wn - w * w, 2.0 * 0.02 * wn * w);
  EXPECT_NEAR(std::abs(mode.response(130.0) / expected - 1.0), 0.0, 1e-14);
  EXPECT_DOUBLE_EQ(model().staticGain(), 1.0);
  EXPECT_NEAR(std::abs(model().response(0.0) - 1.0), 0.0, 1e-15);
}

TEST(ModalFilter, zeroOrderStepIsExact) {
  ModalFilter filter(model(), RATE, Hold::zero_order);
  EXPECT_DOUBLE_EQ(filter.step(1.0), model().direct);  // no time has passed yet
  for (int i = 1; i < 5000; ++i) {
    double expected = model().direct;
    for (const Mode& mode : model().modes) expected += mode.gain * stepResponse(mode, i / RATE);
    ASSERT_NEAR(filter.step(1.0), expected, 1e-11) << i;
  }
}

TEST(ModalFilter, firstOrderRampIsExact) {
  ModalFilter filter(model(), RATE, Hold::first_order);
  for (int i = 0; i < 5000; ++i) {
    const double t = i / RATE;
    double expected = model().direct * t;
    for (const Mode& mode : model().modes) expected += mode.gain * rampResponse(mode, t);
    ASSERT_NEAR(filter.step(t), expected, 1e-12) << i;
  }
}

// A sampled harmonic with linear interpolation contains sinc^2(f / rate) of the harmonic. Its images are near
// multiples of the rate, where the modes hardly respond (600 Hz: image 41 times higher, response below 1e-3
// of 1e-3).
TEST(ModalFilter, firstOrderReproducesAHarmonic) {
  const double f = 600.0;
  ModalModel one;
  one.modes = {{930.0, 0.03, 1.0}};
  ModalFilter filter(one, RATE, Hold::first_order);
  const double x = units::PI * f / RATE, sinc = std::sin(x) / x;
  const Complex expected = one.response(f) * sinc * sinc;
  for (int i = 0; i < 25600; ++i) {
    const Complex input = std::polar(1.0, TWO_PI * f * i / RATE);
    const double output = filter.step(input.real());
    if (i > 12800) {
      ASSERT_NEAR(output, (expected * input).real(), 1e-5);
    }
  }
}

TEST(ModalFilter, staysInTheStaticStateAfterReset) {
  for (const Hold hold : {Hold::zero_order, Hold::first_order}) {
    ModalFilter filter(model(), RATE, hold);
    filter.reset(7.0);
    for (int i = 0; i < 1000; ++i) ASSERT_NEAR(filter.step(7.0), 7.0, 1e-11);
    filter.reset();
    EXPECT_DOUBLE_EQ(filter.step(0.0), 0.0);
  }
}

TEST(ModalFilter, rejectsInvalidModes) {
  ModalModel bad;
  bad.modes = {{100.0, 1.0, 1.0}};
  EXPECT_THROW(ModalFilter(bad, RATE, Hold::zero_order), Error);
  bad.modes = {{0.0, 0.1, 1.0}};
  EXPECT_THROW(ModalFilter(bad, RATE, Hold::zero_order), Error);
  EXPECT_THROW(ModalFilter(model(), 0.0, Hold::zero_order), Error);
}

TEST(StateSpace, hasTheFrequencyResponseOfTheModes) {
  const StateSpace system = stateSpace(model());
  for (const double f : {1.0, 12.0, 500.0, 930.0, 4100.0, 9000.0}) {
    const Eigen::MatrixXcd resolvent =
        (Complex(0.0, TWO_PI * f) * Eigen::MatrixXcd::Identity(6, 6) - system.a.cast<Complex>())
            .partialPivLu()
            .solve(system.b.cast<Complex>());
    const Complex response = (system.c.cast<Complex>() * resolvent + system.d.cast<Complex>())(0, 0);
    EXPECT_NEAR(std::abs(response - model().response(f)) / std::abs(model().response(f)), 0.0, 1e-12) << f;
  }
}

// Zero-order hold by the matrix exponential of state and input together.
TEST(StateSpace, discretisedEqualsTheZeroOrderFilter) {
  StateSpace system = stateSpace(model());
  Eigen::MatrixXd joint = Eigen::MatrixXd::Zero(7, 7);
  joint << system.a, system.b, Eigen::MatrixXd::Zero(1, 7);
  const Eigen::MatrixXd transition = linear::exponential(joint / RATE);
  system.a = transition.topLeftCorner(6, 6);
  system.b = transition.topRightCorner(6, 1);
  ModalFilter filter(model(), RATE, Hold::zero_order);
  Eigen::VectorXd state = Eigen::VectorXd::Zero(6);
  for (int i = 0; i < 2000; ++i) {
    const double input = std::sin(0.02 * i) + (i % 7);
    ASSERT_NEAR(filter.step(input), (system.c * state + system.d * input)(0, 0), 1e-11);
    state = system.a * state + system.b * input;
  }
}

TEST(MatrixExponential, closedForms) {
  Eigen::MatrixXd rotation(2, 2);
  rotation << 0.0, -3.0, 3.0, 0.0;
  const Eigen::MatrixXd turned = linear::exponential(rotation);
  EXPECT_NEAR(turned(0, 0), std::cos(3.0), 1e-14);
  EXPECT_NEAR(turned(1, 0), std::sin(3.0), 1e-14);
  Eigen::MatrixXd nilpotent = Eigen::MatrixXd::Zero(3, 3);
  nilpotent(0, 1) = 2.0;
  nilpotent(1, 2) = 5.0;
  const Eigen::MatrixXd finite = linear::exponential(nilpotent);
  EXPECT_NEAR(finite(0, 2), 5.0, 1e-14);
  EXPECT_NEAR(finite(0, 1), 2.0, 1e-14);
  EXPECT_EQ(linear::exponential(Eigen::MatrixXd(0, 0)).size(), 0);
}

TEST(DiscretiseNoise, integratorChain) {
  // White acceleration of density q: the textbook covariance of position and speed.
  Eigen::MatrixXd a(2, 2), q(2, 2);
  a << 0.0, 1.0, 0.0, 0.0;
  q << 0.0, 0.0, 0.0, 4.0;
  const double dt = 3.0;
  const auto [phi, qd] = discretiseNoise(a, q, dt);
  EXPECT_NEAR(phi(0, 1), dt, 1e-13);
  EXPECT_NEAR(qd(0, 0), 4.0 * dt * dt * dt / 3.0, 1e-11);
  EXPECT_NEAR(qd(0, 1), 4.0 * dt * dt / 2.0, 1e-12);
  EXPECT_NEAR(qd(1, 1), 4.0 * dt, 1e-12);
}

TEST(DiscretiseNoise, decayOverAnyStep) {
  // x' = -r x + w: variance q (1 - exp(-2 r dt)) / (2 r); at r dt = 50 the direct form loses all digits to
  // exp(+50).
  for (const double rate_step : {1e-6, 0.1, 5.0, 50.0}) {
    const Eigen::MatrixXd a = Eigen::MatrixXd::Constant(1, 1, -100.0),
                          q = Eigen::MatrixXd::Constant(1, 1, 3.0);
    const double dt = rate_step / 100.0;
    const auto [phi, qd] = discretiseNoise(a, q, dt);
    EXPECT_NEAR(phi(0, 0) / std::exp(-rate_step), 1.0, 1e-12);
    EXPECT_NEAR(qd(0, 0) / (-3.0 * std::expm1(-2.0 * rate_step) / 200.0), 1.0, 1e-10) << rate_step;
  }
}

}  // namespace
}  // namespace smartmill
