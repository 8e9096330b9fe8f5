#include "smartmill_stability/chart/uncertainty.h"

#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_stability_testing/oracles.h"

namespace smartmill::stability {
namespace {

using units::radPerSecFromRpm;

UncertainSystem uncertain(const RegenerativeSystem& system, double scale = 1.0) {
  return {system,
          std::vector<ModeUncertainty>(system.modes.size(), {0.005 * scale, 0.1 * scale, 0.05 * scale}),
          0.05 * scale, 0.05 * scale};
}

TEST(Uncertainty, drawsHaveTheStatedScatter) {
  const RegenerativeSystem system = benchmarkSystem(1.0, true, false);
  const UncertainSystem u = uncertain(system);
  std::mt19937_64 random(7);
  double f = 0.0, ff = 0.0, z = 0.0, zz = 0.0, k = 0.0, kk = 0.0;
  constexpr int N = 4000;
  for (int i = 0; i < N; ++i) {
    const RegenerativeSystem drawn = u.draw(random);
    const double a = drawn.modes[0].frequency / 922.0 - 1.0, b = drawn.modes[0].damping_ratio / 0.011 - 1.0;
    // Static compliance: input output / w^2.
    const double w = units::TWO_PI * drawn.modes[0].frequency, w0 = units::TWO_PI * 922.0;
    const double c = drawn.modes[0].input[0] * drawn.modes[0].output[0] / (w * w) * 0.03993 * w0 * w0 - 1.0;
    f += a, ff += a * a, z += b, zz += b * b, k += c, kk += c * c;
  }
  // Four standard errors, as shares of the standard deviation: of the mean and of the estimated deviation.
  const double of_mean = 4.0 / std::sqrt(N), of_deviation = 4.0 / std::sqrt(2.0 * N);
  EXPECT_NEAR(f / N, 0.0, of_mean * 0.005);
  EXPECT_NEAR(z / N, 0.0, of_mean * 0.1);
  EXPECT_NEAR(k / N, 0.0, of_mean * 0.05);
  EXPECT_NEAR(std::sqrt(ff / N), 0.005, of_deviation * 0.005);
  EXPECT_NEAR(std::sqrt(zz / N), 0.1, of_deviation * 0.1);
  EXPECT_NEAR(std::sqrt(kk / N), 0.05, of_deviation * 0.05);
}

TEST(Uncertainty, probabilityWithoutUncertaintyIsAStep) {
  const UncertainSystem u = uncertain(benchmarkSystem(1.0, true, false), 0.0);
  const double speed = radPerSecFromRpm(10000.0);  // 0.32238 mm
  EXPECT_EQ(chatterProbability(u, speed, 0.3222e-3, 5, 1), 0.0);
  EXPECT_EQ(chatterProbability(u, speed, 0.3226e-3, 5, 1), 1.0);
}

// With uncertain coefficients only, the limit is proportional to 1 / coefficient, so the probability has a
// closed form.
TEST(Uncertainty, coefficientsAloneFollowTheLogNormalLaw) {
  const RegenerativeSystem system = benchmarkSystem(1.0, true, false);
  constexpr double SHARE = 0.1;
  // kt and kr are drawn independently; with kt = 0 only kr scales the limit.
  RegenerativeSystem radial = system;
  radial.kt = 0.0;
  const double speed = radPerSecFromRpm(10000.0);
  const double limit = makeSolver(Method::collocation, radial)->limit(speed, 10e-3).depth;
  const UncertainSystem u(radial, {{0.0, 0.0, 0.0}}, 0.0, SHARE);
  const double s = std::sqrt(std::log1p(SHARE * SHARE));
  for (const double ratio : {0.9, 1.0, 1.1}) {
    const double expected = 0.5 * std::erfc(-(std::log(ratio) - 0.5 * s * s) / s / std::sqrt(2.0));
    // Four standard errors of 1500 draws.
    EXPECT_NEAR(chatterProbability(u, speed, ratio * limit, 1500, 3), expected, 0.052) << ratio;
  }
}

// Reliability: 200 machines, each known from a measurement with the stated errors. The probability predicted
// from the measurement must equal the observed frequency of chatter on the true machines.
TEST(Uncertainty, predictedProbabilityIsTheObservedShare) {
  std::mt19937_64 random(2024);
  std::uniform_real_distribution<double> unit;
  constexpr int MACHINES = 200, DRAWS = 24, BINS = 4;
  double predicted[BINS] = {}, observed[BINS] = {};
  int count[BINS] = {};
  double all_predicted = 0.0, all_observed = 0.0, variance = 0.0;
  int n = 0;
  for (int i = 0; i < MACHINES; ++i) {
    // Flat prior: the true machine is drawn around the measured one.
    const RegenerativeSystem measured = benchmarkSystem(0.5, i % 2 == 0, false);
    const UncertainSystem posterior = uncertain(measured);
    const RegenerativeSystem truth = posterior.draw(random);
    const double speed = radPerSecFromRpm(9000.0 + 11000.0 * unit(random));
    const double nominal = makeSolver(Method::collocation, measured)->limit(speed, 10e-3).depth;
    if (!std::isfinite(nominal)) continue;
    const double depth = nominal * (0.75 + 0.5 * unit(random));
    const double p = chatterProbability(posterior, speed, depth, DRAWS, static_cast<unsigned>(1000 + i));
    const bool chatters =
        makeFloquetSolver(Method::collocation, truth)->multiplier(speed, depth).radius() > 1.0;
    const int bin = std::min(BINS - 1, static_cast<int>(p * BINS));
    predicted[bin] += p;
    observed[bin] += chatters;
    ++count[bin];
    all_predicted += p;
    all_observed += chatters;
    variance += p * (1.0 - p);
    ++n;
  }
  std::cout << "predicted/observed by quarter:";
  for (int b = 0; b < BINS; ++b) {
    std::cout << ' ' << predicted[b] / count[b] << '/' << observed[b] / count[b] << " of " << count[b];
    // Three standard errors of the bin and of the draws of each prediction.
    const double p = predicted[b] / count[b];
    EXPECT_NEAR(observed[b] / count[b], p, 3.0 * std::sqrt((p * (1.0 - p) + 0.05) / count[b])) << b;
  }
  std::cout << '\n';
  EXPECT_NEAR(all_observed / n, all_predicted / n, 3.0 * std::sqrt(variance + 1.0) / n);
}

TEST(Uncertainty, chartIsMonotonicAndRobustPointsKeepTheRisk) {
  const UncertainSystem u = uncertain(benchmarkSystem(0.5, true, false));
  std::vector<double> speeds, depths;
  for (int i = 0; i <= 24; ++i) speeds.push_back(radPerSecFromRpm(9000.0 + 500.0 * i));
  for (int j = 1; j <= 30; ++j) depths.push_back(0.1e-3 * j);
  const ProbabilityChart chart = probabilityChart(u, speeds, depths, 20, 5);
  for (const auto& row : chart.probability)
    for (std::size_t d = 0; d + 1 < row.size(); ++d) EXPECT_LE(row[d], row[d + 1] + 1e-12);
  const auto points = robustPoints(chart, 0.05, 0.03, 3);
  ASSERT_FALSE(points.empty());
  for (const RobustPoint& p : points) {
    EXPECT_LE(p.probability, 0.05);
    // Agrees with 60 draws of another seed (binomial).
    EXPECT_LE(chatterProbability(u, p.speed, p.depth, 60, 99), 0.15);
  }
}

TEST(Uncertainty, usesTheStandardDeviationsOfTheModel) {
  MachineModel model = machine();
  model.tool_tip.x = benchmark();
  model.tool_tip.x.modes[0].frequency_std = 9.22;
  model.cutting = CuttingCoefficients{6e8, 2e8, 0.0, 0.0, 0.0, 0.0};
  model.uncertainty.damping = 20.0;
  RegenerativeSystem system = benchmarkSystem(1.0, true, false);
  const UncertainSystem u = UncertainSystem::of(model, system);
  std::mt19937_64 random(3);
  double f = 0.0, z = 0.0;
  constexpr int N = 2000;
  for (int i = 0; i < N; ++i) {
    const RegenerativeSystem drawn = u.draw(random);
    f += std::pow(drawn.modes[0].frequency - 922.0, 2);
    z += std::pow(drawn.modes[0].damping_ratio / 0.011 - 1.0, 2);
  }
  EXPECT_NEAR(std::sqrt(f / N), 9.22, 0.7);
  EXPECT_NEAR(std::sqrt(z / N), 0.2, 0.02);
}

TEST(Uncertainty, refusesInvalidValues) {
  const RegenerativeSystem system = benchmarkSystem(1.0, true, false);
  EXPECT_THROW(UncertainSystem(system, {}, 0.1, 0.1), Error);
  EXPECT_THROW(UncertainSystem(system, {{-0.1, 0.0, 0.0}}, 0.1, 0.1), Error);
  EXPECT_THROW(chatterProbability(uncertain(system), 1000.0, 1e-3, 0, 1), Error);
}

}  // namespace
}  // namespace smartmill::stability
