// Systems beyond the even pitch of the tables: uneven pitch, helix, process damping, unusual modes.

#include "smartmill_stability/solvers/solver.h"

#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_stability_testing/oracles.h"

namespace smartmill::stability {
namespace {

using units::radPerSecFromRpm;

constexpr double MAX_DEPTH = 10e-3;

// Three solvers without a common discretization agree for an uneven pitch.
TEST(UnevenPitch, solversAgree) {
  RegenerativeSystem system = benchmarkSystem(0.3, true, true);
  system.pitch = {units::radFromDeg(170.0), units::radFromDeg(190.0)};
  SolverOptions steps;
  steps.steps = 1440;
  steps.order = 2;
  SolverOptions harmonics;
  harmonics.harmonics = 12;
  for (const double rpm : {9000.0, 16000.0}) {
    const double speed = radPerSecFromRpm(rpm);
    const Limit spectral = makeSolver(Method::collocation, system)->limit(speed, MAX_DEPTH);
    const Limit semi = makeSolver(Method::semi_discretization, system, steps)->limit(speed, MAX_DEPTH);
    const Limit multi = makeSolver(Method::multi_frequency, system, harmonics)->limit(speed, MAX_DEPTH);
    ASSERT_TRUE(std::isfinite(spectral.depth));
    EXPECT_NEAR(semi.depth / spectral.depth, 1.0, 2e-3) << rpm;
    EXPECT_NEAR(multi.depth / spectral.depth, 1.0, 2e-3) << rpm;
    EXPECT_NEAR(semi.frequency, spectral.frequency, 0.2) << rpm;
    EXPECT_EQ(semi.kind, spectral.kind) << rpm;
  }
}

TEST(UnevenPitch, convergesToEvenPitch) {
  const RegenerativeSystem even = benchmarkSystem(0.3, true, false);
  RegenerativeSystem nearly = even;
  nearly.pitch = {units::PI * (1.0 + 1e-6), units::PI * (1.0 - 1e-6)};
  const double speed = radPerSecFromRpm(11000.0);
  const Limit a = makeSolver(Method::collocation, even)->limit(speed, MAX_DEPTH);
  const Limit b = makeSolver(Method::collocation, nearly)->limit(speed, MAX_DEPTH);
  EXPECT_NEAR(b.depth / a.depth, 1.0, 1e-4);
  EXPECT_NEAR(b.frequency, a.frequency, 0.1);
}

TEST(Helix, solversAgreeAndConvergeToNoHelix) {
  RegenerativeSystem system = benchmarkSystem(0.3, true, true);
  const double speed = radPerSecFromRpm(13000.0);
  const double straight = makeSolver(Method::collocation, system)->limit(speed, MAX_DEPTH).depth;
  system.helix = 1e-4;
  EXPECT_NEAR(makeSolver(Method::collocation, system)->limit(speed, MAX_DEPTH).depth / straight, 1.0, 1e-4);
  system.helix = units::radFromDeg(40.0);
  SolverOptions options;
  options.steps = 800;
  options.order = 2;
  for (const double rpm : {7000.0, 13000.0, 20000.0}) {
    const Limit spectral = makeSolver(Method::collocation, system)->limit(radPerSecFromRpm(rpm), MAX_DEPTH);
    const Limit semi =
        makeSolver(Method::semi_discretization, system, options)->limit(radPerSecFromRpm(rpm), MAX_DEPTH);
    ASSERT_TRUE(std::isfinite(spectral.depth)) << rpm;
    EXPECT_NEAR(semi.depth / spectral.depth, 1.0, 1e-3) << rpm;
  }
}

// Frequency-domain solution with the lag of the edge at the limit, compared with collocation: Hopf, flip, and
// speeds that are stable to the largest depth.
TEST(Helix, multiFrequencyAgreesWithCollocation) {
  RegenerativeSystem system = benchmarkSystem(0.3, true, false);
  system.helix = units::radFromDeg(30.0);
  SolverOptions options;
  options.tolerance = 1e-4;
  for (const double rpm : {8000.0, 11000.0, 13000.0, 16000.0}) {
    const double speed = radPerSecFromRpm(rpm);
    const Limit spectral = makeSolver(Method::collocation, system)->limit(speed, MAX_DEPTH);
    const Limit multi = makeSolver(Method::multi_frequency, system, options)->limit(speed, MAX_DEPTH);
    EXPECT_EQ(std::isfinite(multi.depth), std::isfinite(spectral.depth)) << rpm;
    if (!std::isfinite(spectral.depth)) continue;
    EXPECT_NEAR(multi.depth / spectral.depth, 1.0, 2e-3) << rpm;
    EXPECT_EQ(multi.kind, spectral.kind) << rpm;
    EXPECT_NEAR(multi.frequency / spectral.frequency, 1.0, 2e-3) << rpm;
  }
}

// Process damping raises the limit at low speed, equally in both Floquet solvers.
TEST(ProcessDamping, raisesTheLimitAtLowSpeed) {
  RegenerativeSystem system = benchmarkSystem(0.5, true, true);
  SolverOptions options;
  options.steps = 800;
  options.order = 2;
  const double slow = radPerSecFromRpm(4100.0);
  const double bare = makeSolver(Method::collocation, system)->limit(slow, MAX_DEPTH).depth;
  system.damping_radial = 5e4;
  system.damping_tangential = 1.5e4;
  const double damped = makeSolver(Method::collocation, system)->limit(slow, MAX_DEPTH).depth;
  const double semi = makeSolver(Method::semi_discretization, system, options)->limit(slow, MAX_DEPTH).depth;
  EXPECT_GT(damped, 1.02 * bare);
  EXPECT_NEAR(semi / damped, 1.0, 1e-3);
}

TEST(Modes, negativeGainAndResidualCompliancePreserveTheReceptance) {
  const ModalModel model{{{500.0, 0.03, -2e-8}, {900.0, 0.02, 5e-8}}, 0.0};
  for (const double f : {100.0, 510.0, 880.0, 2000.0}) {
    const auto g = receptance(systemModes(model, 1), f);
    EXPECT_NEAR(std::abs(g[3] - model.response(f)), 0.0, 1e-6 * std::abs(model.response(f)));
    EXPECT_EQ(std::abs(g[0]) + std::abs(g[1]), 0.0);
  }
  ModalModel with_direct = model;
  with_direct.direct = 1e-8;
  const auto g = receptance(systemModes(with_direct, 0), 450.0);
  EXPECT_NEAR(std::abs(g[0] - with_direct.response(450.0)), 0.0, 0.25 * 1e-8);
}

}  // namespace
}  // namespace smartmill::stability
