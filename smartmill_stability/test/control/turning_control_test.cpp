#include "smartmill_stability/control/turning_control.h"

#include <cmath>
#include <cstdio>
#include <memory>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_stability_testing/kim_case.h"

namespace smartmill::stability {
namespace {

constexpr double FREQUENCY = 350.0, DAMPING = 0.02;

TEST(Merritt, criticalStiffnessRatioAndFrequency) {
  EXPECT_NEAR(merrittLimit(DAMPING), 0.0408, 1e-12);
  // Kim eq. 5 on a fine grid.
  const SecondOrder machine{0.0408, FREQUENCY, DAMPING};
  double least = 0.0, at = 0.0;
  for (double w = 300.0; w < 420.0; w += 0.001) {
    const double re = machine.response(w).real();
    if (re < least) {
      least = re;
      at = w;
    }
  }
  EXPECT_NEAR(least, -0.5, 1e-6);
  EXPECT_NEAR(criticalFrequency(FREQUENCY, DAMPING), at, 2e-3);
}

// Growth of the vibration from the second to the third segment, compared with the dominant characteristic
// root.
TEST(TurningSimulation, growsAtTheRateOfTheCharacteristicRoot) {
  for (const double logarithm : {1.0, 2.0, 3.0}) {
    const TurningProcess process = kimProcess(logarithm);
    const TurningRun run = simulateTurning(process, 3.0 * SEGMENT, CONTROL_RATE, 0.0, 1, {});
    const double growth =
        std::log(vibration(run, 2.0 * SEGMENT, 3.0 * SEGMENT) / vibration(run, SEGMENT, 2.0 * SEGMENT));
    EXPECT_NEAR(growth, logarithm, 0.02 * logarithm + 0.02);
  }
}

TEST(TurningSimulation, stableBelowMerrittsLimitAndWithoutOverlap) {
  TurningProcess process = kimProcess(3.0);
  process.stiffness_ratio = 0.95 * merrittLimit(DAMPING);
  EXPECT_LT(growthRate(process), 0.0);
  process.stiffness_ratio = 0.1;
  process.overlap = 0.0;
  EXPECT_LT(growthRate(process), 0.0);
  const TurningRun run = simulateTurning(process, 2.0, CONTROL_RATE, 0.0, 1, {});
  EXPECT_NEAR(run.motion.back(), process.chip * 0.1 / 1.1,
              1e-3 * process.chip);  // static: y = K/K_m (a0 - y)
}

TEST(Guard, marginDependsOnTheMismatchOfTheModel) {
  const SecondOrder machine{0.1, FREQUENCY, DAMPING};
  // Uncontrolled: eq. 5 scaled, -0.5 x 0.1 / 0.0408.
  EXPECT_NEAR(residualMargin(machine, SecondOrder()), -0.5 * 0.1 / 0.0408, 1e-3);
  EXPECT_NEAR(residualMargin(machine, machine), 0.0, 1e-12);
  SecondOrder off = machine;
  off.frequency *= 1.1;
  EXPECT_LT(residualMargin(machine, off), -0.5);
  SecondOrder uncertain = machine;
  uncertain.covariance(1, 1) = std::pow(0.03 * FREQUENCY, 2);
  EXPECT_LT(worstMargin(uncertain, machine), -0.5);
  uncertain.covariance(1, 1) = std::pow(0.001 * FREQUENCY, 2);
  EXPECT_GT(worstMargin(uncertain, machine), -0.4);
}

struct Outcome {
  double reduction = 0.0;  ///< [1] of the uncontrolled vibration over the last half second
  std::vector<SecondOrder> estimates;
};

Outcome controlled(const TurningProcess& process, const TurningRun& free, unsigned seed) {
  // Noise: 1 % of the vibration (rms) of the first, uncontrolled segment.
  const double noise = 0.01 * vibration(free, 0.0, SEGMENT);
  const auto controller = std::make_shared<AdaptiveChatterController>(kimController(process));
  const TurningRun run = simulateTurning(process, 3.0 * SEGMENT + 0.001, CONTROL_RATE, noise, seed,
                                         [controller](double y, double t) { return controller->step(y, t); });
  return {1.0 - vibration(run, 5.644, 6.144) / vibration(free, 5.644, 6.144), controller->estimates()};
}

// Kim's case; the paper states 327/0.05, 332/0.11, 335/0.06, 346/0.07 (rad/s, damping) for successive
// estimates.
TEST(KimsCase, identifiesTheMachineAndSuppressesTheChatterForFiftySeeds) {
  for (const double logarithm : {1.0, 2.0, 3.0}) {
    const TurningProcess process = kimProcess(logarithm);
    const TurningRun free = simulateTurning(process, 3.0 * SEGMENT, CONTROL_RATE, 0.0, 1, {});
    constexpr unsigned seeds = 50;
    double worst_frequency = 0.0, worst_damping = 0.0, least_reduction = 1.0;
    double first[2] = {}, second[2] = {};
    for (unsigned seed = 1; seed <= seeds; ++seed) {
      const Outcome outcome = controlled(process, free, seed);
      ASSERT_EQ(outcome.estimates.size(), 3u);
      const SecondOrder& third = outcome.estimates[2];
      worst_frequency = std::max(worst_frequency, std::abs(third.frequency / FREQUENCY - 1.0));
      worst_damping = std::max(worst_damping, std::abs(third.damping_ratio / DAMPING - 1.0));
      least_reduction = std::min(least_reduction, outcome.reduction);
      first[0] += outcome.estimates[0].frequency / seeds,
          first[1] += outcome.estimates[0].damping_ratio / seeds;
      second[0] += outcome.estimates[1].frequency / seeds,
          second[1] += outcome.estimates[1].damping_ratio / seeds;
    }
    std::printf(
        "T %.5f s, growth e^%.0f per segment, %u seeds: mean estimates %.2f/%.4f, %.2f/%.4f; third: largest "
        "error "
        "%.3f %% in frequency, %.2f %% in damping; smallest reduction %.3f %%\n",
        process.period, logarithm, seeds, first[0], first[1], second[0], second[1], 100.0 * worst_frequency,
        100.0 * worst_damping, 100.0 * least_reduction);
    EXPECT_LT(worst_frequency, 0.01);
    EXPECT_LT(worst_damping, 0.2);
    EXPECT_GT(least_reduction, 0.95);
  }
}

// The plain ratio of spectra, as used by Kim, is smeared by the window: its half-power bandwidth is not that
// of the machine. The fit with leakage in the model is unbiased on the same data.
TEST(KimsCase, thePlainRatioIsBiasedByLeakage) {
  const TurningProcess process = kimProcess(1.0);
  const TurningRun run = simulateTurning(process, SEGMENT, CONTROL_RATE, 0.0, 1, {});
  std::vector<double> chip, deflection;
  const double back = process.period * CONTROL_RATE;
  for (std::size_t i = 0; i < 20480; i += 10) {
    const double at = static_cast<double>(i) - back;
    double past = 0.0;
    if (at >= 0.0) {
      const auto k = static_cast<std::size_t>(at);
      past = run.motion[k] + (at - static_cast<double>(k)) * (run.motion[k + 1] - run.motion[k]);
    }
    chip.push_back(process.chip - run.motion[i] + past);
    deflection.push_back(run.deflection[i]);
  }
  const SegmentEstimate found = estimateSegment(chip, deflection, EstimatorParameters());
  ASSERT_TRUE(found.informed);
  EXPECT_NEAR(found.model.frequency, FREQUENCY, 0.002 * FREQUENCY);
  EXPECT_NEAR(found.model.damping_ratio, DAMPING, 0.05 * DAMPING);
  EXPECT_NEAR(found.model.gain, 0.1, 0.02 * 0.1);  // linear interpolation between samples of 1 ms: 1 %
  // Peak of the plain ratio compared with the true one, gain / (2 zeta) = 2.5.
  double peak = 0.0;
  for (std::size_t l = 0; l < found.ratio.size(); ++l)
    if (std::abs(found.frequency[l] - FREQUENCY / units::TWO_PI) < 5.0)
      peak = std::max(peak, std::abs(found.ratio[l]));
  EXPECT_GT(std::abs(peak / 2.5 - 1.0), 0.1);
}

// The standard deviations of the first segment match the scatter over seeds.
TEST(KimsCase, standardDeviationsCoverTheError) {
  const TurningProcess process = kimProcess(2.0);
  const TurningRun free = simulateTurning(process, SEGMENT, CONTROL_RATE, 0.0, 1, {});
  const double noise = 0.01 * vibration(free, 0.0, SEGMENT);
  constexpr unsigned SEEDS = 60;
  double mean[2] = {}, squares[2] = {}, stated[2] = {};
  for (unsigned seed = 1; seed <= SEEDS; ++seed) {
    AdaptiveChatterController controller(kimController(process));
    simulateTurning(process, SEGMENT + 0.001, CONTROL_RATE, noise, seed,
                    [&](double y, double t) { return controller.step(y, t); });
    const SecondOrder& m = controller.segments().at(0).model;
    const double value[2] = {m.frequency, m.damping_ratio};
    for (int k = 0; k < 2; ++k) {
      mean[k] += value[k] / SEEDS;
      squares[k] += value[k] * value[k] / SEEDS;
      stated[k] += m.covariance(k + 1, k + 1) / SEEDS;
    }
  }
  for (int k = 0; k < 2; ++k) {
    const double scatter = std::sqrt(squares[k] - mean[k] * mean[k]);
    // The scatter of 60 seeds is known to 9 %; the noise of the chip thickness is not white after the model.
    EXPECT_GT(std::sqrt(stated[k]) / scatter, 0.5) << k;
    EXPECT_LT(std::sqrt(stated[k]) / scatter, 2.0) << k;
  }
}

// Kim's proposal: spindle accelerometers instead of the deflection.
TEST(Accelerometers, giveTheSameMachine) {
  const TurningProcess process = kimProcess(2.0);
  const TurningRun run = simulateTurning(process, SEGMENT + 0.01, CONTROL_RATE, 0.0, 1, {});
  AccelerationIntegrator integrator(2.0, CONTROL_RATE);
  std::vector<double> motion(run.motion.size(), 0.0);
  const double h2 = CONTROL_RATE * CONTROL_RATE;
  for (std::size_t i = 1; i + 1 < run.deflection.size(); ++i)
    motion[i] =
        integrator.step((run.deflection[i + 1] - 2.0 * run.deflection[i] + run.deflection[i - 1]) * h2);
  std::vector<double> chip, deflection;
  const auto back = static_cast<std::size_t>(std::lround(process.period * CONTROL_RATE));
  for (std::size_t i = 0; i < 20480; i += 10) {
    chip.push_back(-motion[i] + (i >= back ? motion[i - back] : 0.0));
    deflection.push_back(motion[i]);
  }
  const SegmentEstimate found = estimateSegment(chip, deflection, EstimatorParameters());
  ASSERT_TRUE(found.informed);
  EXPECT_NEAR(found.model.frequency, FREQUENCY, 0.01 * FREQUENCY);
  EXPECT_NEAR(found.model.damping_ratio, DAMPING, 0.2 * DAMPING);
}

// The two classical schemes: force feedback with a fixed model that is 10 % off does not suppress the
// chatter; displacement error feedback increases the stiffness by 1 + gain and suppresses it here.
TEST(ClassicalSchemes, comparedWithAnExactModel) {
  const TurningProcess process = kimProcess(2.0);
  const TurningRun free = simulateTurning(process, 3.0 * SEGMENT, CONTROL_RATE, 0.0, 1, {});
  const double uncontrolled = vibration(free, 5.644, 6.144);
  const auto with = [&](const ControlLaw& law) {
    return vibration(simulateTurning(process, 3.0 * SEGMENT, CONTROL_RATE, 0.0, 1, law), 5.644, 6.144) /
           uncontrolled;
  };
  SecondOrder exact{0.1, FREQUENCY, DAMPING}, off = exact;
  off.frequency *= 1.1;
  const double right = with(forceFeedbackControl(exact, process, CONTROL_RATE));
  const double wrong = with(forceFeedbackControl(off, process, CONTROL_RATE));
  const double displacement = with(displacementErrorControl(3.0, 1000.0, CONTROL_RATE));
  std::printf(
      "vibration over uncontrolled: force, exact model %.2g; force, model 10 %% off %.2g; displacement error "
      "%.2g\n",
      right, wrong, displacement);
  EXPECT_LT(right, 0.01);
  EXPECT_GT(wrong, 1.0);
  EXPECT_LT(displacement, 0.05);
}

TEST(Turning, refusesInvalidValues) {
  TurningProcess process;
  process.damping_ratio = 0.0;
  EXPECT_THROW(growthRate(process), Error);
  ControllerParameters parameters;
  parameters.rate = 1234.5;
  EXPECT_THROW(AdaptiveChatterController{parameters}, Error);
  EXPECT_THROW(estimateSegment({1.0}, {1.0}, EstimatorParameters()), Error);
}

}  // namespace
}  // namespace smartmill::stability
