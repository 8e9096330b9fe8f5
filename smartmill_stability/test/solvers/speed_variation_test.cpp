#include <cmath>
#include <functional>
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

/// Independent solution for one mode along x over one variation: steps with the delayed motion interpolated
/// linearly, as a full matrix; the delay follows from the angle of the spindle by bisection.
struct SteppedSystem {
  double frequency, damping_ratio, mass;
  double pitch;                             // [rad]
  std::function<double(double)> stiffness;  // [N/m] against x - x(t - delay), over the angle of the spindle

  double radius(const SpeedVariation& variation, double speed, int steps) const {
    const double amplitude = variation.amplitude, ratio = variation.ratio;
    const double h = units::TWO_PI / (ratio * speed) / steps;
    const auto angle = [&](double t) {
      return speed * t + amplitude / ratio * (1.0 - std::cos(ratio * speed * t));
    };
    const double longest = pitch / speed / (1.0 - amplitude);
    const auto delayAt = [&](double t) {
      double low = 0.0, high = longest;
      for (int i = 0; i < 60; ++i) {
        const double middle = 0.5 * (low + high);
        (angle(t) - angle(t - middle) < pitch ? low : high) = middle;
      }
      return low;
    };
    const int past = static_cast<int>(longest / h) + 3;
    // State: x, x', then x of the steps before.
    Eigen::MatrixXd map = Eigen::MatrixXd::Identity(past + 2, past + 2);
    for (int i = 0; i < steps; ++i) {
      constexpr int PARTS = 50;  // of a step, for the mean stiffness
      double mean = 0.0;         // [1/s2]
      for (int k = 0; k < PARTS; ++k) mean += stiffness(angle((i + (k + 0.5) / PARTS) * h)) / mass / PARTS;
      // x'' + 2 z w x' + (w^2 + K) x = K x(t - delay): exact for a force that is constant over a step.
      const double w = units::TWO_PI * frequency, z = damping_ratio * w, square = w * w + mean;
      const double wd = std::sqrt(square - z * z), e = std::exp(-z * h);
      const double c = std::cos(wd * h), s = std::sin(wd * h) / wd;
      Eigen::Matrix2d flow;
      flow << e * (c + z * s), e * s, -e * square * s, e * (c - z * s);
      const double back = delayAt((i + 0.5) * h) / h - 0.5;  // of the middle of the step, from its beginning
      const int whole = static_cast<int>(back);
      const double share = back - whole;
      const auto row = [&](int k) { return k == 0 ? map.row(0) : map.row(k + 1); };
      const Eigen::RowVectorXd force = mean * ((1.0 - share) * row(whole) + share * row(whole + 1));
      Eigen::MatrixXd next(map.rows(), map.cols());
      next.row(0) = flow(0, 0) * map.row(0) + flow(0, 1) * map.row(1) + (1.0 - flow(0, 0)) / square * force;
      next.row(1) = flow(1, 0) * map.row(0) + flow(1, 1) * map.row(1) - flow(1, 0) / square * force;
      next.row(2) = map.row(0);
      next.bottomRows(past - 1) = map.middleRows(2, past - 1);
      map.swap(next);
    }
    return map.eigenvalues().cwiseAbs().maxCoeff();
  }

  /// Second order in the step.
  double extrapolated(const SpeedVariation& variation, double speed, int steps) const {
    const double coarse = radius(variation, speed, steps), fine = radius(variation, speed, 2 * steps);
    return fine + (fine - coarse) / 3.0;
  }
};

TEST(SpeedVariation, turningAgreesWithAnIndependentSolution) {
  DampedSlot slot;
  slot.waves = 1;
  const RegenerativeSystem system = varied(slot.system(), 0.2, 0.5);
  const double speed = units::radPerSecFromRpm(6000.0);
  const auto solver = makeFloquetSolver(Method::collocation, system);
  for (const double depth : {1e-4, 2e-4, 4e-4}) {
    const SteppedSystem stepped{slot.frequency, slot.damping_ratio, slot.mass, units::TWO_PI,
                                [&](double) { return slot.kr * depth; }};
    // 16 and 33 steps in a vibration.
    EXPECT_NEAR(
        solver->multiplier(speed, depth).radius() / stepped.extrapolated(*system.variation, speed, 300), 1.0,
        2e-3)
        << depth;
  }
}

// Down-milling with two teeth, half immersion: entries and exits move with the angle.
TEST(SpeedVariation, interruptedMillingAgreesWithAnIndependentSolution) {
  const RegenerativeSystem system = varied(benchmarkSystem(0.5, true, false), 0.2, 0.5);
  const double speed = units::radPerSecFromRpm(6000.0);
  const auto solver = makeFloquetSolver(Method::collocation, system);
  for (const double depth : {2e-4, 1e-3, 4e-3}) {
    const SteppedSystem stepped{922.0, 0.011, 0.03993, units::PI, [&](double angle) {
                                  // One tooth after the other from 90 to 180 deg.
                                  const double phi = std::fmod(angle, units::PI);
                                  if (phi < 0.5 * units::PI) return 0.0;
                                  return depth * std::sin(phi) *
                                         (system.kt * std::cos(phi) + system.kr * std::sin(phi));
                                }};
    EXPECT_NEAR(
        solver->multiplier(speed, depth).radius() / stepped.extrapolated(*system.variation, speed, 400), 1.0,
        2e-3)
        << depth;
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
