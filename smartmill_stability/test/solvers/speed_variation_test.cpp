#include <cmath>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_stability/solvers/delayed_system.h"
#include "smartmill_stability_testing/damped_slot.h"
#include "smartmill_stability_testing/oracles.h"

namespace smartmill::stability {
namespace {

using ::testing::HasSubstr;

double limitOf(const RegenerativeSystem& system, double rpm) {
  return makeSolver(Method::collocation, system)->limit(units::radPerSecFromRpm(rpm), 0.1).depth;
}

RegenerativeSystem varied(RegenerativeSystem system, double amplitude, double ratio,
                          SpeedVariation::Shape shape = SpeedVariation::Shape::sine) {
  system.variation = SpeedVariation{amplitude, ratio, shape};
  return system;
}

TEST(SpeedVariation, withoutAmplitudeTheLimitIsThatOfTheMeanSpeed) {
  RegenerativeSystem milling = benchmarkSystem(0.5, true, true), helix = milling, uneven = milling;
  helix.helix = units::radFromDeg(30.0);
  uneven.pitch = {units::radFromDeg(170.0), units::radFromDeg(190.0)};
  RegenerativeSystem damped = milling;
  damped.setProcessDamping(20e3);
  DampedSlot turning;
  turning.waves = 1;
  for (const RegenerativeSystem& system : {milling, helix, uneven, damped, turning.system()}) {
    for (const double rpm : {3100.0, 9000.0}) {
      // The tolerance of the searched depth is 1e-6.
      EXPECT_NEAR(limitOf(varied(system, 0.0, 0.25), rpm) / limitOf(system, rpm), 1.0, 1e-5) << rpm;
    }
  }
}

// Two tooth passings in a variation: one variation, and two of them, have the same stability.
TEST(SpeedVariation, multipliersOfTwoVariationsAreTheSquares) {
  const RegenerativeSystem system = varied(benchmarkSystem(0.5, true, true), 0.2, 1.0);
  const DelayedSystem one = delayedSystem(system, units::radPerSecFromRpm(5000.0), 1e-3);
  DelayedSystem two = one;
  two.period *= 2.0;
  for (const double t : one.breaks) two.breaks.push_back(t + one.period);
  const double once = collocationMultiplier(one, 12).radius(),
               twice = collocationMultiplier(two, 12).radius();
  EXPECT_NEAR(twice / (once * once), 1.0, 1e-6);
}

/// Independent solution for turning with one mode: steps with the delayed motion interpolated linearly, as a
/// full matrix; the delay follows from the angle of the spindle by bisection.
double turningRadius(const DampedSlot& slot, double amplitude, double ratio, double speed, double depth,
                     int steps) {
  const double period = units::TWO_PI / (ratio * speed), h = period / steps, w = slot.natural();
  const auto angle = [&](double t) {
    return speed * t + amplitude / ratio * (1.0 - std::cos(ratio * speed * t));
  };
  const auto delayAt = [&](double t) {
    double low = 0.0, high = units::TWO_PI / speed / (1.0 - amplitude);
    for (int i = 0; i < 60; ++i) {
      const double middle = 0.5 * (low + high);
      (angle(t) - angle(t - middle) < units::TWO_PI ? low : high) = middle;
    }
    return low;
  };
  const int past = static_cast<int>(units::TWO_PI / speed / (1.0 - amplitude) / h) + 3;
  const double stiffness = slot.kr * depth / slot.mass;  // [1/s2]
  // x'' + 2 z w x' + (w^2 + K) x = K x(t - delay): exact for a force that is constant over a step.
  const double z = slot.damping_ratio * w, wd = std::sqrt(w * w + stiffness - z * z), e = std::exp(-z * h);
  const double c = std::cos(wd * h), s = std::sin(wd * h) / wd;
  Eigen::Matrix2d flow;
  flow << e * (c + z * s), e * s, -e * (w * w + stiffness) * s, e * (c - z * s);
  const double still = 1.0 / (w * w + stiffness);
  // State: x, x', then x of the steps before.
  Eigen::MatrixXd map = Eigen::MatrixXd::Identity(past + 2, past + 2);
  for (int i = 0; i < steps; ++i) {
    const double back = delayAt((i + 0.5) * h) / h - 0.5;  // of the middle of the step, from its beginning
    const int whole = static_cast<int>(back);
    const double share = back - whole;
    const auto row = [&](int k) { return k == 0 ? map.row(0) : map.row(k + 1); };
    const Eigen::RowVectorXd force = stiffness * ((1.0 - share) * row(whole) + share * row(whole + 1));
    Eigen::MatrixXd next(map.rows(), map.cols());
    next.row(0) = flow(0, 0) * map.row(0) + flow(0, 1) * map.row(1) + (1.0 - flow(0, 0)) * still * force;
    next.row(1) = flow(1, 0) * map.row(0) + flow(1, 1) * map.row(1) - flow(1, 0) * still * force;
    next.row(2) = map.row(0);
    next.bottomRows(past - 1) = map.middleRows(2, past - 1);
    map.swap(next);
  }
  return map.eigenvalues().cwiseAbs().maxCoeff();
}

TEST(SpeedVariation, turningAgreesWithAnIndependentSolution) {
  DampedSlot slot;
  slot.waves = 1;
  const RegenerativeSystem system = varied(slot.system(), 0.2, 0.5);
  const double speed = units::radPerSecFromRpm(6000.0);
  const auto solver = makeFloquetSolver(Method::collocation, system);
  for (const double depth : {1e-4, 2e-4, 4e-4}) {
    // Second order in the step: extrapolated from 300 and 600 steps, 16 and 33 per vibration.
    const double coarse = turningRadius(slot, 0.2, 0.5, speed, depth, 300),
                 fine = turningRadius(slot, 0.2, 0.5, speed, depth, 600),
                 exact = fine + (fine - coarse) / 3.0;
    EXPECT_NEAR(solver->multiplier(speed, depth).radius() / exact, 1.0, 2e-3) << depth;
  }
}

// Insperger and Stepan (J. Vibration and Control 10, 2004): the modulation raises the limit where many waves
// lie between successive cuts, and hardly does in the first lobes. With many waves the phase between the
// surfaces passes through all values in one variation.
TEST(SpeedVariation, raisesTheLimitAtLowSpeed) {
  DampedSlot slot;
  slot.waves = 1;
  const RegenerativeSystem steady = slot.system(), modulated = varied(steady, 0.1, 0.1);
  const auto least = [&](const RegenerativeSystem& system, double low, double high) {
    double depth = 1.0;
    for (int i = 0; i <= 10; ++i) depth = std::min(depth, limitOf(system, low + (high - low) * i / 10.0));
    return depth;
  };
  // Over one lobe, which begins at this number of waves between the cuts.
  const auto gain = [&](double waves) {
    const double low = 60.0 * slot.frequency / (waves + 1.0), high = 60.0 * slot.frequency / waves;
    return least(modulated, low, high) / least(steady, low, high);
  };
  EXPECT_GT(gain(16.5), 3.0);
  EXPECT_LT(gain(1.5), 1.3);
}

TEST(SpeedVariation, refusesWhatCannotBe) {
  const RegenerativeSystem system = benchmarkSystem(0.5, true, true);
  for (const Method method : {Method::semi_discretization, Method::multi_frequency, Method::zero_order})
    EXPECT_THAT(errorOf([&] { makeSolver(method, varied(system, 0.1, 0.1)); }),
                HasSubstr("speed variation: expected collocation"));
  EXPECT_THAT(
      errorOf([&] { limitOf(varied(system, 0.1, 0.0951734), 3000.0); }),
      HasSubstr("ratio of the speed variation 0.0951734: expected a ratio at which up to 20 variations"));
  EXPECT_THROW(makeSolver(Method::collocation, varied(system, 1.0, 0.1)), Error);
  RegenerativeSystem chip = varied(system, 0.1, 0.1);
  chip.chip.emplace();
  chip.chip->feed = 1e-4;
  EXPECT_THAT(errorOf([&] { makeSolver(Method::collocation, chip); }),
              HasSubstr("chip geometry with a speed variation"));
}

}  // namespace
}  // namespace smartmill::stability
