#include "smartmill_loadmeter/identification/test_information.h"

#include <Eigen/Dense>

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/units.h"

namespace smartmill::loadmeter {
namespace {

constexpr double RADIUS = 9.525e-3, DEPTH = 1e-3, GAIN = 3.88e-4;
constexpr int TEETH = 4;

Spindle spindle() {
  Spindle s;
  s.load_meter_gain = GAIN;
  return s;
}

ToolGeometry tool() {
  return {TEETH, 2.0 * RADIUS, units::radFromDeg(30.0), {}};
}

CuttingCondition test(double speed, double feed) {
  CuttingCondition t;
  t.kind = feed > 0.0 ? CuttingCondition::Kind::cut : CuttingCondition::Kind::air;
  t.tool = tool();
  t.spindle_speed = speed;
  t.engagement = {0.0, units::PI, DEPTH, feed};
  return t;
}

// The tests of the shipped session.
std::vector<CuttingCondition> session() {
  std::vector<CuttingCondition> tests;
  for (const double speed : {314.2, 628.3, 942.5, 1256.6}) tests.push_back(test(speed, 0.0));
  for (const double feed : {5e-5, 1e-4, 1.5e-4, 2e-4}) tests.push_back(test(418.9, feed));
  return tests;
}

// Mean torque of a slot per unit of Ktc and Kte: N a R (2 c Ktc + pi Kte) / (2 pi).
Eigen::Vector4d rowOf(const CuttingCondition& t) {
  const double share = TEETH * DEPTH * RADIUS / units::TWO_PI;
  if (t.kind == CuttingCondition::Kind::air) return {0.0, 0.0, 1.0, t.spindle_speed};
  return {2.0 * t.engagement.feed_per_tooth * share, units::PI * share, 1.0, t.spindle_speed};
}

// Weighted least squares on random readings scatters as predicted.
TEST(ExpectedCovariance, isThatOfLeastSquaresOnSimulatedTests) {
  const std::vector<CuttingCondition> tests = session();
  const TorqueCovariance expected = expectedCovariance(tests, spindle(), nullptr);
  std::mt19937 random(7);
  std::normal_distribution<double> normal(0.0, TYPICAL_VOLTAGE_STD);
  const Eigen::Vector4d scale{1e9, 1e4, 0.1, 1e-3};
  constexpr int RUNS = 4000;
  double tc = 0.0, te = 0.0, tc_te = 0.0;
  for (int run = 0; run < RUNS; ++run) {
    Eigen::MatrixXd a(8, 4);
    Eigen::VectorXd b(8);
    for (Eigen::Index i = 0; i < 8; ++i) {
      const CuttingCondition& t = tests[static_cast<std::size_t>(i)];
      a.row(i) = GAIN * t.spindle_speed * rowOf(t).cwiseProduct(scale).transpose();  // [V]
      b[i] = normal(random);
    }
    const Eigen::Vector4d x = a.colPivHouseholderQr().solve(b);
    tc += std::pow(1e9 * x[0], 2) / RUNS, te += std::pow(1e4 * x[1], 2) / RUNS,
        tc_te += 1e13 * x[0] * x[1] / RUNS;
  }
  // Three standard deviations of a variance from 4000 runs are 7 %.
  EXPECT_NEAR(expected.tc / tc, 1.0, 0.07);
  EXPECT_NEAR(expected.te / te, 1.0, 0.07);
  EXPECT_NEAR(expected.tc_te / tc_te, 1.0, 0.1);
}

TEST(ExpectedCovariance, isUnknownWithoutEnoughTests) {
  EXPECT_TRUE(std::isinf(expectedCovariance({}, spindle(), nullptr).tc));
  EXPECT_TRUE(std::isinf(
      expectedCovariance({test(400.0, 1e-4), test(300.0, 0.0), test(600.0, 0.0)}, spindle(), nullptr).te));
}

TEST(NeededTests, areAllWithoutKnowledgeAndFewerTheMoreIsKnown) {
  const std::vector<CuttingCondition> tests = session();
  const TorqueCovariance all = expectedCovariance(tests, spindle(), nullptr);
  const auto scaled = [&](double s) { return TorqueCovariance{s * all.tc, s * all.tc_te, s * all.te}; };
  EXPECT_EQ(neededTests(tests, spindle(), scaled(1e6)).size(), 8u);
  // A session as certain as the planned one.
  const auto after_one = neededTests(tests, spindle(), scaled(1.0));
  ASSERT_EQ(after_one.size(), 4u) << "two air cuts and two cuts check the knowledge";
  EXPECT_EQ(after_one[0], 0u) << "the only air cut slower than the slots: friction is not extrapolated";
  EXPECT_LE(after_one.size(), neededTests(tests, spindle(), scaled(4.0)).size());
  for (const double s : {0.01, 1.0, 4.0}) {
    std::vector<CuttingCondition> chosen;
    for (const std::size_t i : neededTests(tests, spindle(), scaled(s))) chosen.push_back(tests[i]);
    const TorqueCovariance prior = scaled(s), after = expectedCovariance(chosen, spindle(), &prior);
    EXPECT_LE(after.tc, all.tc * (1.0 + 1e-9));
    EXPECT_LE(after.te, all.te * (1.0 + 1e-9));
  }
  EXPECT_TRUE(neededTests({}, spindle(), scaled(1.0)).empty());
}

// With Ktc known the edge term is found at a small feed, with Kte known the chip term at a large one; a
// torque limit excludes it.
TEST(MostInformativeCut, addressesTheLessCertainCoefficient) {
  CuttingCoefficients value;
  value.ktc = 8e8, value.kte = 2e4;
  const SuggestionLimits limits{200.0, 800.0, 5e-5, 2e-4, 1e-3, 1e-3, 0.0, 0.0};
  const TorqueCovariance of_kte{1e10, 0.0, 1e8}, of_ktc{1e16, 0.0, 1.0};
  const auto edge = mostInformativeCut(tool(), spindle(), value, of_kte, limits);
  const auto chip = mostInformativeCut(tool(), spindle(), value, of_ktc, limits);
  ASSERT_TRUE(edge && chip);
  EXPECT_EQ(edge->engagement.feed_per_tooth, 5e-5);
  EXPECT_EQ(chip->engagement.feed_per_tooth, 2e-4);
  EXPECT_EQ(chip->speed, 800.0) << "eq. 3.12: a volt is less torque at high speed";
  // One unknown: 1 / sigma^2 = 1 / prior^2 + sensitivity^2 / (2 torque variance).
  const double sensitivity = TEETH * DEPTH * RADIUS / units::PI * 2e-4;
  const double torque_std = TYPICAL_VOLTAGE_STD / (GAIN * 800.0);
  EXPECT_NEAR(chip->ktc_std, 1.0 / std::sqrt(1e-16 + std::pow(sensitivity / torque_std, 2) / 2.0),
              0.001 * chip->ktc_std);
  SuggestionLimits weak = limits;
  weak.torque = 0.5 * chip->torque;
  EXPECT_LT(mostInformativeCut(tool(), spindle(), value, of_ktc, weak)->torque, 0.5 * chip->torque);
  weak.torque = 1e-6;
  EXPECT_FALSE(mostInformativeCut(tool(), spindle(), value, of_ktc, weak));
}

}  // namespace
}  // namespace smartmill::loadmeter
