#include <cmath>
#include <complex>
#include <functional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/solvers/delayed_system.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {
namespace {

using units::PI;
using units::TWO_PI;

/// A mill with limits of a few millimetres, down-milling at half immersion.
RegenerativeSystem mill(double helix_deg = 30.0) {
  ModalModel x, y;
  x.modes = {{1210.0, 0.031, 1.0 / 28e6}};
  y.modes = {{1180.0, 0.029, 1.0 / 31e6}};
  RegenerativeSystem system;
  system.modes = systemModes(x, y);
  system.teeth = 4;
  system.diameter = 20e-3;
  system.helix = units::radFromDeg(helix_deg);
  system.entry = 0.5 * PI;
  system.exit = PI;
  system.kt = 796e6;
  system.kr = 168e6;
  system.ka = 90e6;
  return system;
}

RegenerativeSystem slot(double helix_deg = 0.0) {
  RegenerativeSystem system = mill(helix_deg);
  system.entry = 0.0;
  return system;
}

void setHelix(RegenerativeSystem& system, const std::vector<double>& deg) {
  ToolGeometry tool = system.tool();
  std::vector<double> helix;
  for (const double d : deg) helix.push_back(units::radFromDeg(d));
  tool.setHelix(helix);
  system.helix = tool.helix;
  system.edge = tool.edge;
}

double limitOf(const RegenerativeSystem& system, double rpm, Method method = Method::collocation,
               const SolverOptions& options = {}) {
  return makeSolver(method, system, options)->limit(units::radPerSecFromRpm(rpm), 50e-3).depth;
}

std::string errorOf(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(EdgeShape, aVanishingCornerIsAStraightMill) {
  for (const double helix : {0.0, 30.0}) {
    const RegenerativeSystem straight = mill(helix);
    RegenerativeSystem rounded = straight;
    rounded.edge.corner_radius = 1e-9;
    for (const double rpm : {5000.0, 9000.0})
      EXPECT_NEAR(limitOf(rounded, rpm) / limitOf(straight, rpm), 1.0, 1e-5) << helix << " " << rpm;
  }
  // Equal helix angles of all teeth.
  RegenerativeSystem equal = mill(30.0);
  setHelix(equal, {30.0, 30.0, 30.0, 30.0});
  EXPECT_NEAR(limitOf(equal, 9000.0) / limitOf(mill(30.0), 9000.0), 1.0, 1e-5);
}

// At an edge angle kappa the chip is sin(kappa) times the distance across the tool and a height b contains an
// edge length b / sin(kappa): a metre of height feeds back kt and kr sin(kappa) - ka cos(kappa).
TEST(EdgeShape, aFaceMillIsAStraightMillWithARotatedForce) {
  for (const double deg : {30.0, 45.0, 75.0}) {
    RegenerativeSystem face = mill(0.0), straight = face;
    const double kappa = units::radFromDeg(deg);
    face.edge.edge_angle = kappa;
    face.ka = 60e6;
    straight.kr = face.kr * std::sin(kappa) - face.ka * std::cos(kappa);
    ASSERT_GT(straight.kr, 0.0);
    for (const Method method : {Method::collocation, Method::zero_order, Method::semi_discretization})
      EXPECT_NEAR(limitOf(face, 9000.0, method) / limitOf(straight, 9000.0, method), 1.0, 1e-5)
          << deg << " " << nameOf(method);
  }
}

// One degree of freedom across the feed, force along it only by kr: with even teeth in a slot the mean
// feedback is exact, and the least limit of all lobes is 2 k z (1 + z) over the mean coefficient.
TEST(EdgeShape, theLeastLimitOfAFaceMillScalesWithItsRadialCoefficient) {
  ModalModel y;
  y.modes = {{1000.0, 0.02, 1.0 / 20e6}};
  RegenerativeSystem system = slot();
  system.modes = systemModes({}, y);
  system.kt = 1.0;  // [N/m2] in effect none
  system.kr = 500e6;
  system.ka = 200e6;
  const double k = 20e6, z = 0.02, teeth = 4.0;
  for (const double deg : {90.0, 60.0, 45.0}) {
    const double kappa = units::radFromDeg(deg);
    system.edge = {};
    if (deg < 90.0) system.edge.edge_angle = kappa;
    const double across = deg < 90.0 ? system.kr * std::sin(kappa) - system.ka * std::cos(kappa) : system.kr;
    const double mean = teeth / TWO_PI * across * 0.5 * PI;  // cos^2 over half a revolution
    const double closed = 2.0 * k * z * (1.0 + z) / mean;
    double least = 1.0;
    for (double rpm = 2500.0; rpm < 3000.0; rpm += 5.0)
      least = std::min(least, limitOf(system, rpm, Method::zero_order));
    EXPECT_NEAR(least / closed, 1.0, 1e-3) << deg;
    EXPECT_GE(least / closed, 1.0 - 1e-5) << deg;
  }
}

// Mean of sin(kappa) over a small height b of a ball: 2/3 sqrt(2 b / r).
TEST(EdgeShape, aBallOfSmallDepthPushesAlongTheTool) {
  RegenerativeSystem ball = mill();
  ball.edge.corner_radius = 10e-3;
  for (const double depth : {1e-7, 1e-6})
    EXPECT_NEAR(ball.meanRadial(depth), ball.kr * 2.0 / 3.0 * std::sqrt(2.0 * depth / 10e-3) - ball.ka,
                1e-3 * ball.ka);
  EXPECT_NEAR(ball.meanRadial(10e-3), ball.kr * PI / 4.0 - ball.ka / 2.0, 1.0);
  EXPECT_NEAR(ball.meanRadial(1.0), ball.kr, 0.02 * ball.kr);
}

// In a slot with four teeth the feedback is constant, and the zero-order solution exact.
TEST(EdgeShape, zeroOrderSolvesForTheDepthOfAnInclinedEdge) {
  for (const double corner : {3e-3, 10e-3}) {
    RegenerativeSystem system = slot();
    system.edge.corner_radius = corner;
    for (const double rpm : {4000.0, 7000.0, 11000.0})
      EXPECT_NEAR(limitOf(system, rpm, Method::zero_order) / limitOf(system, rpm), 1.0, 2e-3)
          << corner << " " << rpm;
  }
}

// Two independent discretisations of time and the harmonic balance, with helix and process damping.
TEST(EdgeShape, methodsAgree) {
  RegenerativeSystem bull = mill(), ball = mill(), varied = mill();
  bull.edge.corner_radius = 3e-3;
  bull.setProcessDamping(2e4);
  ball.edge.corner_radius = 10e-3;
  setHelix(varied, {25.0, 35.0, 25.0, 35.0});
  SolverOptions fine;
  fine.nodes = 20;
  fine.steps = 200;
  for (const RegenerativeSystem& system : {bull, ball, varied}) {
    const double limit = limitOf(system, 9000.0);
    EXPECT_NEAR(limitOf(system, 9000.0, Method::collocation, fine) / limit, 1.0, 1e-4);
    EXPECT_NEAR(limitOf(system, 9000.0, Method::semi_discretization, fine) / limit, 1.0, 3e-3);
    EXPECT_NEAR(limitOf(system, 9000.0, Method::multi_frequency) / limit, 1.0, 3e-3);
  }
}

// The delays of a variable helix are distributed over the depth b: with tau(z) = tau_0 + s z the mean of
// exp(-i w tau) is exp(-i w (tau_0 + s b / 2)) sinc(w s b / 2) (Sims, Mann, Huyanan 2008).
TEST(EdgeShape, delaysOfAVariableHelixAreDistributed) {
  RegenerativeSystem system = mill();
  setHelix(system, {25.0, 40.0, 25.0, 40.0});
  const ToolGeometry tool = system.tool();
  const double speed = units::radPerSecFromRpm(6000.0), depth = 6e-3;
  const DelayedSystem delayed = delayedSystem(system, speed, depth);
  EXPECT_NEAR(delayed.period, TWO_PI / speed, 1e-12);
  // Mean over a revolution of the feedback at w.
  constexpr int STEPS = 20000;
  for (const double w : {TWO_PI * 600.0, TWO_PI * 1200.0}) {
    Eigen::Matrix2cd mean = Eigen::Matrix2cd::Zero();
    Feedback f;
    for (int i = 0; i < STEPS; ++i) {
      const double t = delayed.period * (i + 0.5) / STEPS;
      delayed.feedback(t, t, f);
      for (std::size_t d = 0; d < f.delayed.size(); ++d)
        mean += f.delayed[d] * std::polar(1.0 / STEPS, -w * delayed.delays[d]);
    }
    std::complex<double> of_delays = 0.0;
    for (int k = 0; k < 4; ++k) {
      const double slope = -(tool.lagOf((k + 1) % 4) - tool.lagOf(k)) / speed, half = 0.5 * w * slope * depth;
      of_delays += std::polar(std::sin(half) / half, -w * (0.5 * PI / speed + 0.5 * slope * depth));
    }
    // yy of one tooth over the arc pi/2 .. pi: -(sin - r cos) cos, r = kr / kt.
    const double yy = system.kt * (-0.5) - system.kr * 0.25 * PI;
    const std::complex<double> closed = -depth * yy / TWO_PI * of_delays;
    EXPECT_NEAR(std::abs(mean(1, 1) - closed), 0.0, 2e-3 * std::abs(depth * yy * 4.0 / TWO_PI));
  }
}

TEST(EdgeShape, refusesWhatCannotBe) {
  const auto message = [](const RegenerativeSystem& system, Method method = Method::collocation) {
    return errorOf([&] { makeSolver(method, system); });
  };
  RegenerativeSystem ball = mill();
  ball.edge.corner_radius = 11e-3;
  EXPECT_NE(message(ball).find("does not fit a tool of radius 10 mm"), std::string::npos);
  ball.edge.corner_radius = 10e-3;
  ball.ka = std::nan("");
  EXPECT_NE(message(ball).find("axial coefficient"), std::string::npos);
  RegenerativeSystem rough = mill();
  rough.edge.serration_amplitude = 1e-4;
  rough.edge.serration_wavelength = 1e-3;
  EXPECT_NE(message(rough).find("serrated edge: expected a chip geometry"), std::string::npos);
  RegenerativeSystem varied = mill();
  setHelix(varied, {25.0, 35.0, 25.0, 35.0});
  EXPECT_NE(message(varied, Method::zero_order).find("zero_order: a helix angle of each tooth"),
            std::string::npos);
  varied.along_arc = [](double) { return std::array<double, 2>{{8e8, 2e8}}; };
  EXPECT_NE(message(varied).find("helix_deg: one of each tooth"), std::string::npos);
  RegenerativeSystem steep = mill();
  setHelix(steep, {0.0, 70.0, 0.0, 70.0});
  EXPECT_NE(errorOf([&] {
              makeFloquetSolver(Method::collocation, steep)->multiplier(600.0, 30e-3);
            }).find("the edges of teeth 1 and 2 meet"),
            std::string::npos);
}

}  // namespace
}  // namespace smartmill::stability
