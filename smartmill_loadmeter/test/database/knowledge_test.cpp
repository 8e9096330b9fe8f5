#include "smartmill_loadmeter/database/knowledge.h"

#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_loadmeter/database/find_coefficients.h"

namespace smartmill::loadmeter {
namespace {

using ::testing::HasSubstr;

constexpr double KTC = 8e8, KTE = 2e4, KTC_STD = 4e6, KTE_STD = 600.0, CORRELATION = -0.8;

// Tests in the seconds before `stamp`.
CoefficientRecord recordOf(double stamp, double ktc, double kte, double scale = 1.0) {
  CoefficientRecord r;
  r.set.tool = "t", r.set.material = "m", r.set.source = "load_meter", r.set.stamp = stamp, r.set.tests = 4;
  r.set.value = r.set.std_dev = NOT_IDENTIFIED;
  r.set.value.ktc = ktc, r.set.value.kte = kte;
  r.set.std_dev.ktc = scale * KTC_STD, r.set.std_dev.kte = scale * KTE_STD;
  r.covariance[CoefficientRecord::covarianceIndex(0, 3)] = scale * scale * CORRELATION * KTC_STD * KTE_STD;
  r.first_stamp = stamp - 60.0;
  r.cutting_speed = 2.0 + 1e-3 * stamp, r.feed_per_tooth = 1e-4, r.axial_depth = 1e-3;
  r.teeth = 4, r.diameter = 0.02, r.helix = 0.5;
  return r;
}

// Two independent estimates of equal covariance: mean, and standard deviations over sqrt(2).
TEST(CombinedRecord, ofEqualCovarianceIsTheMean) {
  const CombinedRecord both = combine(recordOf(2000, KTC + 2e6, KTE), recordOf(1000, KTC - 2e6, KTE + 400.0));
  EXPECT_TRUE(both.agree);
  EXPECT_NEAR(both.record.set.value.ktc, KTC, 1.0);
  EXPECT_NEAR(both.record.set.value.kte, KTE + 200.0, 1e-6);
  EXPECT_NEAR(both.record.set.std_dev.ktc, KTC_STD / std::sqrt(2.0), 1.0);
  EXPECT_NEAR(both.record.covariance[CoefficientRecord::covarianceIndex(0, 3)],
              0.5 * CORRELATION * KTC_STD * KTE_STD, 1.0);
  EXPECT_EQ(both.record.set.tests, 8);
  EXPECT_EQ(both.record.set.stamp, 2000.0);
}

// A coefficient that only one record has changes by its correlation alone.
TEST(CombinedRecord, keepsWhatOnlyOneKnows) {
  CoefficientRecord only_ktc = recordOf(1000, KTC + 4e6, NAN);
  only_ktc.set.std_dev.kte = NAN;
  const CombinedRecord both = combine(recordOf(2000, KTC, KTE), only_ktc);
  // Conditional mean: half the difference of Ktc, times the regression of Kte on Ktc.
  EXPECT_NEAR(both.record.set.value.kte, KTE + CORRELATION * KTE_STD / KTC_STD * 2e6, 1e-3);
  EXPECT_LT(both.record.set.std_dev.kte, KTE_STD);
  CoefficientRecord without = only_ktc;
  without.set.std_dev.ktc = NAN;
  EXPECT_DOUBLE_EQ(combine(recordOf(2000, KTC, KTE), without).record.set.value.ktc, KTC);
}

// Independent draws: the combined error is within its standard deviation as often as a normal error, and one
// pair in a hundred disagrees.
TEST(CombinedRecord, standardDeviationsAndAgreementHaveTheirCoverage) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  const auto draw = [&](double stamp, double scale) {
    const double a = normal(random), b = normal(random);
    return recordOf(
        stamp, KTC + scale * KTC_STD * a,
        KTE + scale * KTE_STD * (CORRELATION * a + std::sqrt(1.0 - CORRELATION * CORRELATION) * b), scale);
  };
  constexpr int RUNS = 4000;
  int within = 0, disagree = 0;
  double squares = 0.0, deviations = 0.0;
  for (int i = 0; i < RUNS; ++i) {
    const CombinedRecord both = combine(draw(2000, 1.4), draw(1000, 1.0));
    const double error = (both.record.set.value.kte - KTE) / both.record.set.std_dev.kte;
    within += std::abs(error) < 1.0 ? 1 : 0;
    squares += error * error / RUNS;
    deviations += both.deviation * both.deviation / RUNS;
    disagree += both.agree ? 0 : 1;
  }
  // Four standard deviations of a share of 4000.
  EXPECT_NEAR(static_cast<double>(within) / RUNS, 0.683, 0.03);
  EXPECT_NEAR(squares, 1.0, 0.09);
  EXPECT_NEAR(deviations, 1.0, 0.065);
  EXPECT_NEAR(static_cast<double>(disagree) / RUNS, 0.01, 0.0065);
}

TEST(CoefficientKnowledge, combinesIndependentIdentificationsUntilTheProcessHasChanged) {
  CoefficientDatabase database("");
  EXPECT_FALSE(knowledgeOf(database, "t", "m"));
  database.add(recordOf(1000, 1.2 * KTC, KTE));  // another process: a sharper edge, for example
  database.add(recordOf(2000, KTC - 2e6, KTE));
  database.add(recordOf(3000, KTC + 2e6, KTE));
  CoefficientRecord repeated = recordOf(3010, KTC + 3e6, KTE);  // the same tests, identified again
  repeated.first_stamp = 2940.0;
  database.add(repeated);
  CoefficientRecord cut = recordOf(3005, KTC, KTE);
  cut.set.source = SOURCE_PRODUCTION;
  cut.feed_per_tooth = 2e-4;
  database.add(cut);
  const auto known = knowledgeOf(database, "t", "m");
  ASSERT_TRUE(known);
  EXPECT_EQ(known->identifications, 2);
  EXPECT_EQ(known->superseded, 1);
  EXPECT_EQ(known->production_cuts, 1);
  EXPECT_NEAR(known->combined.set.value.ktc, KTC + 0.5e6, 1.0);
  EXPECT_NEAR(known->combined.set.std_dev.ktc, KTC_STD / std::sqrt(2.0), 1.0);
  EXPECT_EQ(known->feed_per_tooth.low, 1e-4);
  EXPECT_EQ(known->feed_per_tooth.high, 2e-4);
  EXPECT_TRUE(std::isnan(known->edge_age.low));
  EXPECT_FALSE(knowledgeOf(database, "t", "other"));
}

// Older files do not say which tests an identification used: they are never counted twice.
TEST(CoefficientKnowledge, recordsOfUnknownTestsAreUsedAlone) {
  CoefficientDatabase database("");
  for (const double stamp : {1000.0, 2000.0}) {
    CoefficientRecord r = recordOf(stamp, KTC, KTE);
    r.first_stamp = CoefficientRecord::UNKNOWN;
    database.add(r);
  }
  const auto known = knowledgeOf(database, "t", "m");
  EXPECT_EQ(known->identifications, 1);
  EXPECT_EQ(known->combined.set.std_dev.ktc, KTC_STD);
}

TEST(FindCoefficients, saysWhatIsKnownAndProposesATestWithinTheCoveredDepth) {
  CoefficientDatabase database("");
  MachineModel model;
  model.tool = ToolGeometry{4, 0.02, 0.5, {}};
  model.spindle.emplace();
  model.spindle->load_meter_gain = 3.88e-4;
  model.spindle->max_speed = 300.0;
  EXPECT_THAT(findCoefficients(database, "t", "m", {}, model).message, HasSubstr("known: no records"));
  database.add(recordOf(2000, KTC, KTE));
  const FoundCoefficients found = findCoefficients(database, "t", "m", {}, model);
  EXPECT_EQ(found.message, "source load_meter, 4 tests in 1 identification");
  ASSERT_TRUE(found.next);
  EXPECT_LT(found.next->ktc_std, KTC_STD);
  EXPECT_EQ(found.next->engagement.axial_depth, 1e-3);
  EXPECT_LE(found.next->speed, 300.0);
  EXPECT_EQ(found.next_condition.tool.teeth, 4);
  const FoundCoefficients other = findCoefficients(database, "new", "m", {}, model);
  EXPECT_FALSE(other.known);
  EXPECT_GT(other.predicted->std_dev.ktc, KTC_STD);
}

}  // namespace
}  // namespace smartmill::loadmeter
