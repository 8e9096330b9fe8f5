#include "smartmill_core/cutting/regression.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

const CuttingCoefficients TRUTH{953e6, 357e6, 188e6, 17.3e3, 17.7e3, 0.72e3};
const ToolGeometry TOOL{3, 0.012, units::radFromDeg(35.0), {}};

std::vector<MeanForceTest> forceTests(bool slots_only) {
  std::vector<MeanForceTest> tests;
  for (int i = 0; i < 8; ++i) {
    MeanForceTest test;
    test.tool = TOOL;
    const double entry = slots_only || i < 4 ? 0.0 : 1.0, exit = slots_only || i < 6 ? units::PI : 2.2;
    test.engagement = {entry, exit, 0.002, 3e-5 + 1.2e-5 * i};
    const CuttingForce mean = MechanisticForce(TOOL, TRUTH, test.engagement).mean();
    test.force = {mean.fx, mean.fy, mean.fz};
    tests.push_back(test);
  }
  return tests;
}

void expectTruth(const CuttingCoefficients& k, double share) {
  EXPECT_NEAR(k.ktc, TRUTH.ktc, share * TRUTH.ktc);
  EXPECT_NEAR(k.krc, TRUTH.krc, share * TRUTH.krc);
  EXPECT_NEAR(k.kac, TRUTH.kac, share * TRUTH.kac);
  EXPECT_NEAR(k.kte, TRUTH.kte, share * TRUTH.kte);
  EXPECT_NEAR(k.kre, TRUTH.kre, share * TRUTH.kre);
  EXPECT_NEAR(k.kae, TRUTH.kae, share * TRUTH.kae);
}

TEST(IdentifyFromForces, findsTheTruthFromExactMeans) {
  expectTruth(identifyFromForces(forceTests(true)).value, 1e-9);
  expectTruth(identifyFromForces(forceTests(false)).value, 1e-9);
}

// Published means of measured/slot_6000 (two decimals) and the published coefficients they lead to; the
// rounding of the means changes the coefficients in the fourth digit (0.005 N of a slope of 19 N).
TEST(IdentifyFromForces, findsThePublishedCoefficientsFromThePublishedMeans) {
  const double feed[] = {0.025e-3, 0.05e-3, 0.075e-3, 0.1e-3, 0.125e-3};
  const double fx[] = {-39.80, -60.05, -71.60, -76.75, -78.49};
  const double fy[] = {63.02, 107.14, 137.67, 171.27, 210.74};
  const double fz[] = {55.72, 70.91, 82.57, 85.23, 83.50};
  std::vector<MeanForceTest> tests;
  for (std::size_t i = 0; i < 5; ++i) {
    MeanForceTest test;
    test.tool = {2, 0.025, units::radFromDeg(45.0), {}};
    test.engagement = {0.0, units::PI, 0.003, feed[i]};
    test.force = {fx[i], fy[i], fz[i]};
    tests.push_back(test);
  }
  const IdentifiedCoefficients found = identifyFromForces(tests);
  EXPECT_NEAR(found.value.ktc, 958.8599e6, 0.1e6);
  EXPECT_NEAR(found.value.krc, 250.8633e6, 0.1e6);
  EXPECT_NEAR(found.value.kac, 146.3614e6, 0.1e6);
  EXPECT_NEAR(found.value.kte, 15.7580e3, 5.0);
  EXPECT_NEAR(found.value.kre, 19.4337e3, 5.0);
  EXPECT_NEAR(found.value.kae, 18.2075e3, 5.0);
  EXPECT_NEAR(found.r_squared_y, 0.997, 0.001);  // printed digits, partly truncated
  EXPECT_NEAR(found.r_squared_x, 0.865, 0.001);
  EXPECT_NEAR(found.r_squared_z, 0.787, 0.001);
}

// Standard deviations are calibrated: the variance of the z-scores over seeded runs is near one.
void coverage(bool weighted, bool slots_only) {
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  const std::array<double, 3> sigma{0.4, 0.8, 0.2};
  const int runs = 400;
  std::array<double, 6> squares{}, stated{};
  for (int run = 0; run < runs; ++run) {
    std::vector<MeanForceTest> tests = forceTests(slots_only);
    for (MeanForceTest& test : tests) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        test.force[axis] += sigma[axis] * normal(random);
        if (weighted) test.force_std[axis] = sigma[axis];
      }
    }
    const IdentifiedCoefficients f = identifyFromForces(tests);
    const double error[] = {f.value.ktc - TRUTH.ktc, f.value.krc - TRUTH.krc, f.value.kac - TRUTH.kac,
                            f.value.kte - TRUTH.kte, f.value.kre - TRUTH.kre, f.value.kae - TRUTH.kae};
    const double std_dev[] = {f.std_dev.ktc, f.std_dev.krc, f.std_dev.kac,
                              f.std_dev.kte, f.std_dev.kre, f.std_dev.kae};
    for (std::size_t i = 0; i < 6; ++i) {
      squares[i] += error[i] * error[i] / runs;
      stated[i] += std_dev[i] * std_dev[i] / runs;
    }
  }
  // Stated over true variance: 400 runs scatter by sqrt(2 / 400) = 7 %, 4 sigma. The weighted fit may state
  // up to a quarter more, because it scales up when the scatter exceeds one by chance.
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_GT(stated[i] / squares[i], 0.72) << i;
    EXPECT_LT(stated[i] / squares[i], weighted ? 1.6 : 1.4) << i;
  }
}

TEST(IdentifyFromForces, standardDeviationsAreCalibrated) {
  coverage(false, true);
  coverage(true, true);
  coverage(true, false);
}

TEST(IdentifyFromForces, errorsNameWhatIsMissing) {
  std::vector<MeanForceTest> tests = forceTests(true);
  for (MeanForceTest& test : tests) test.engagement.feed_per_tooth = 5e-5;
  EXPECT_THROW(identifyFromForces(tests), Error);
  EXPECT_THROW(identifyFromForces({}), Error);
  tests = forceTests(true);
  tests[2].force[1] = NAN;
  EXPECT_THROW(identifyFromForces(tests), Error);
  tests = forceTests(true);
  tests[0].force_std = {1.0, 1.0, 1.0};
  EXPECT_THROW(identifyFromForces(tests), Error);
}

}  // namespace
}  // namespace smartmill
