// Numeric checks of the errors of the documents that docs/seeds.md lists: the form given there as right
// agrees with a direct computation, the printed one does not.

#include <algorithm>
#include <cmath>
#include <complex>
#include <random>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill::studies {
namespace {

using Complex = std::complex<double>;
using units::PI;
using units::TWO_PI;

/// Integral by the midpoint rule.
template <typename Function>
auto integral(double from, double to, int steps, const Function& f) {
  const double step = (to - from) / steps;
  auto sum = f(from + 0.5 * step);
  for (int i = 1; i < steps; ++i) sum += f(from + (i + 0.5) * step);
  return decltype(sum)(sum * step);
}

double infinityNorm(const Eigen::MatrixXd& a) {
  return a.cwiseAbs().rowwise().sum().maxCoeff();
}

// Dunwoody 5.18, 5.24..5.26.
TEST(DocumentErrors, theInverseOfAModeHasANormNearOne) {
  const double w = TWO_PI * 1500.0, zeta = 0.03;
  Eigen::Matrix2d a;
  a << -2.0 * zeta * w, 1.0, -w * w, 0.0;
  const double norm = infinityNorm(a.inverse());
  EXPECT_NEAR(norm, 1.0 + 2.0 * zeta / w, 1e-9);
  EXPECT_GT(w / zeta, 1e5 * norm);
  EXPECT_NEAR(infinityNorm(a) * norm / (w * w), 1.0, 1e-4);
}

// Dunwoody 6.10..6.14, slot.
TEST(DocumentErrors, theLimitTakesTheNegativeReciprocalOfTheEigenvalue) {
  constexpr int TEETH = 4;
  const double kt = 6e8, kr = 0.3, wc = TWO_PI * 830.0;
  const Eigen::Matrix2d alpha = integral(0.0, PI, 2000, [&](double p) {
    Eigen::Matrix2d a;
    a << -(std::sin(2 * p) + kr * (1 - std::cos(2 * p))), -(1 + std::cos(2 * p) + kr * std::sin(2 * p)),
        1 - std::cos(2 * p) - kr * std::sin(2 * p), std::sin(2 * p) - kr * (1 + std::cos(2 * p));
    return a;
  });
  const Eigen::Matrix2d mean = TEETH / TWO_PI * alpha;  // of 6.3..6.6 over a revolution
  const auto receptance = [&](double f, double zeta, double k) {
    const double r = wc / (TWO_PI * f);
    return 1.0 / k / Complex(1.0 - r * r, 2.0 * zeta * r);
  };
  Eigen::Matrix2cd phi = Eigen::Matrix2cd::Zero();
  phi(0, 0) = receptance(800.0, 0.03, 2e7);
  phi(1, 1) = receptance(750.0, 0.04, 3e7);
  const auto remainder = [&](Complex lambda) {  // of 6.10 with depth and period by 6.12, 6.14
    const double kappa = lambda.imag() / lambda.real();
    const double depth = -TWO_PI * lambda.real() / (TEETH * kt) * (1.0 + kappa * kappa);
    const double period = (PI - 2.0 * std::atan(kappa) + 3.0 * TWO_PI) / wc;
    const Complex share = 0.5 * kt * depth * (1.0 - std::polar(1.0, -wc * period));
    return std::abs((Eigen::Matrix2cd::Identity() - share * mean.cast<Complex>() * phi).determinant());
  };
  for (int k = 0; k < 2; ++k) {
    const Complex of_alpha =
        Eigen::ComplexEigenSolver<Eigen::Matrix2cd>(alpha.cast<Complex>() * phi).eigenvalues()(k);
    const Complex of_mean =
        Eigen::ComplexEigenSolver<Eigen::Matrix2cd>(mean.cast<Complex>() * phi).eigenvalues()(k);
    EXPECT_LT(remainder(-1.0 / of_alpha), 1e-12);
    EXPECT_GT(remainder(of_mean), 0.5);
  }
}

// Kim 5..7.
TEST(DocumentErrors, kimsLeastRealPartIsExact) {
  for (const double zeta : {0.02, 0.1, 0.3, 0.6}) {
    const auto real = [&](double square) {
      return (Complex(1.0) / Complex(1.0 - square, 2.0 * zeta * std::sqrt(square))).real();
    };
    const double square = 1.0 + 2.0 * zeta, least = -1.0 / (4.0 * zeta * (1.0 + zeta));
    EXPECT_NEAR(real(square), least, 1e-12 * std::abs(least));
    for (double off = -0.5; off <= 2.0; off += 0.01)
      EXPECT_GE(real(square + zeta * off), least * (1 + 1e-12));
    EXPECT_NEAR(2.0 * (zeta + zeta * zeta) * least, -0.5, 1e-12);
  }
}

// Burzoni 2-3 integrated, 2-7.
TEST(DocumentErrors, edgeForcesOfMeanForcesHaveTheSingleAngle) {
  const double ktc = 7e8, krc = 2e8, kte = 2e4, kre = 3e4, depth = 1e-3, feed = 1e-4, in = 0.3, out = 2.0,
               z = 4.0;
  const Eigen::Vector2d mean =
      z / TWO_PI * integral(in, out, 20000, [&](double p) {
        const double ft = depth * (ktc * feed * std::sin(p) + kte),
                     fr = depth * (krc * feed * std::sin(p) + kre);
        return Eigen::Vector2d(-ft * std::cos(p) - fr * std::sin(p), ft * std::sin(p) - fr * std::cos(p));
      });
  const auto formula = [&](double multiple) {
    const auto at = [&](double p) {
      const double cut = z * depth * feed / (8.0 * PI), edge = z * depth / TWO_PI;
      return Eigen::Vector2d(cut * (ktc * std::cos(2 * p) - krc * (2 * p - std::sin(2 * p))) +
                                 edge * (-kte * std::sin(p) + kre * std::cos(multiple * p)),
                             cut * (ktc * (2 * p - std::sin(2 * p)) + krc * std::cos(2 * p)) -
                                 edge * (kte * std::cos(p) + kre * std::sin(multiple * p)));
    };
    return Eigen::Vector2d(at(out) - at(in));
  };
  EXPECT_LT((formula(1.0) - mean).norm(), 1e-5);
  EXPECT_GT((formula(2.0) - mean).norm(), 30.0);
}

// Burzoni 4-2: K v = lambda M v has the square of the frequency of 4-14. Free vibration in a mode,
// integrated.
TEST(DocumentErrors, theEigenvalueIsTheSquareOfTheFrequency) {
  const Eigen::Vector2d mass(1.0, 2.0);
  Eigen::Matrix2d k;
  k << 4e4, -3e4, -3e4, 3e4;
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::Matrix2d> modes(k, mass.asDiagonal().toDenseMatrix());
  const double step = 1e-5;
  Eigen::Vector2d x = modes.eigenvectors().col(0), v = Eigen::Vector2d::Zero();
  std::vector<double> zeros;
  for (int i = 0; i < 60000; ++i) {
    v -= step * (k * x).cwiseQuotient(mass);
    const double before = x(0);
    x += step * v;
    if (before * x(0) < 0.0) zeros.push_back((i + before / (before - x(0))) * step);
  }
  const double w = PI * static_cast<double>(zeros.size() - 1) / (zeros.back() - zeros.front());
  EXPECT_NEAR(w * w / modes.eigenvalues()(0), 1.0, 1e-3);
}

// Burzoni 4-21: Laplace transform of a free decay.
TEST(DocumentErrors, theInitialVelocityIsAdded) {
  const double w = 50.0, zeta = 0.1, s = 5.0, x0 = 0.3, v0 = 20.0, damped = w * std::sqrt(1.0 - zeta * zeta);
  const double transform = integral(0.0, 4.0, 400000, [&](double t) {
    return std::exp(-(s + zeta * w) * t) *
           (x0 * std::cos(damped * t) + (v0 + zeta * w * x0) / damped * std::sin(damped * t));
  });
  const double below = s * s + 2.0 * zeta * w * s + w * w;
  EXPECT_NEAR(transform, ((s + 2.0 * zeta * w) * x0 + v0) / below, 1e-7);
  EXPECT_LT(((s + 2.0 * zeta * w) * x0 - v0) / below, 0.0);
}

// Burzoni 5-39, 5-55, from 5-37 and 5-43.
TEST(DocumentErrors, informationAddsAndTheGainHasNoInverse) {
  Eigen::Matrix2d prior;
  prior << 2.0, 0.5, 0.5, 1.0;
  const Eigen::RowVector2d h(1.0, 0.4);
  const double r = 0.7;
  const Eigen::Vector2d gain = prior * h.transpose() / (h * prior * h.transpose() + r);
  const Eigen::Matrix2d posterior = (Eigen::Matrix2d::Identity() - gain * h) * prior,
                        information = h.transpose() / r * h, inverse = prior.inverse();
  EXPECT_LT((posterior.inverse() - inverse - information).norm(), 1e-12);
  EXPECT_GT((posterior.inverse() - inverse * information).norm(), 1.0);
  EXPECT_LT((posterior * h.transpose() / r - gain).norm(), 1e-12);
  EXPECT_GT((inverse * h.transpose() / (h * inverse * h.transpose() + r) - gain).norm(), 0.1);
  EXPECT_GT((inverse * h.transpose() / r - gain).norm(), 0.03);
}

// Burzoni 6-3, 6-4: H1 of nine averages with output noise of coherence 0.9. The formula is of first order in
// 1 / n: 15 %.
TEST(DocumentErrors, theDeviationOfThePhaseDoesNotDependOnThePhase) {
  constexpr int AVERAGES = 9;
  const double coherence = 0.9, formula = std::sqrt((1.0 - coherence) / (coherence * 2.0 * AVERAGES));
  std::mt19937_64 random(5);
  std::normal_distribution<double> draw(0.0, std::sqrt(0.5));
  for (const double phase : {0.05, 1.0, 3.0}) {
    const Complex truth = std::polar(2.0, phase);
    const double noise = std::abs(truth) * std::sqrt((1.0 - coherence) / coherence);
    std::vector<double> sizes, angles;
    for (int k = 0; k < 5000; ++k) {
      Complex cross = 0.0;
      double power = 0.0;
      for (int i = 0; i < AVERAGES; ++i) {
        const Complex input(draw(random), draw(random)), error(draw(random), draw(random));
        cross += std::conj(input) * (truth * input + noise * error);
        power += std::norm(input);
      }
      sizes.push_back(std::abs(cross / power / truth));
      angles.push_back(std::arg(cross / power / truth));
    }
    EXPECT_NEAR(standardDeviation(sizes), formula, 0.15 * formula);
    EXPECT_NEAR(standardDeviation(angles), formula, 0.15 * formula);
    if (phase != 1.0) {
      EXPECT_GT(std::abs(standardDeviation(angles) - formula * phase), 0.5 * formula);
    }
  }
}

}  // namespace
}  // namespace smartmill::studies
