#include "smartmill_loadmeter/database/recommend.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/database/oblique.h"

namespace smartmill::loadmeter {
namespace {

using units::radFromDeg;

CoefficientRecord record(const std::string& tool, const std::string& material, double ktc, double share,
                         double stamp = 1.0) {
  CoefficientRecord r;
  r.set.stamp = stamp;
  r.set.tool = tool;
  r.set.material = material;
  r.set.source = "force";
  r.set.value = r.set.std_dev = NOT_IDENTIFIED;
  r.set.value.ktc = ktc, r.set.std_dev.ktc = share * ktc;
  r.set.value.kte = 2e4, r.set.std_dev.kte = share * 2e4;
  return r;
}

/// The titanium of Budak, Altintas and Armarego (1996) without its dependence on chip thickness.
CoefficientRecord titanium(const std::string& tool, double rake_deg, double helix_deg) {
  const ShearZone zone{613e6, radFromDeg(30.0 + 0.5 * rake_deg), radFromDeg(19.1 + 0.29 * rake_deg)};
  const CuttingCoefficients k = obliqueCoefficients(zone, radFromDeg(rake_deg), radFromDeg(helix_deg));
  CoefficientRecord r = record(tool, "titanium", k.ktc, 0.01);
  r.set.value.krc = k.krc, r.set.std_dev.krc = 0.01 * k.krc;
  r.set.value.kac = k.kac, r.set.std_dev.kac = 0.02 * std::abs(k.kac);
  r.rake = radFromDeg(rake_deg);
  r.helix = radFromDeg(helix_deg);
  return r;
}

CoefficientQuery queryOf(const std::string& tool, const std::string& material) {
  CoefficientQuery query;
  query.tool = tool;
  query.material = material;
  return query;
}

/// Two tools in steel, one of them in aluminium.
void fill(CoefficientDatabase& database, const std::string& in_aluminium) {
  database.add(record("a", "steel", 2e9, 0.01));
  database.add(record("b", "steel", 2.2e9, 0.01));
  database.add(record(in_aluminium, "aluminium", 0.8e9, 0.01));
}

TEST(RecommendCut, thePairsOwnRecordsAreMostCertain) {
  CoefficientDatabase database("");
  fill(database, "b");
  const auto answer = recommendCut(database, queryOf("a", "steel"));
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->method, EstimationMethod::pair);
  EXPECT_DOUBLE_EQ(answer->set.value.ktc, 2e9);
  EXPECT_LT(answer->ktc_lower, 2e9);
  EXPECT_GT(answer->ktc_upper, 2e9);
  EXPECT_EQ(answer->message.find('\n'), std::string::npos);
}

// Two tools, two materials, three pairs cut: in logs the fourth is their sum, K = 0.8 x 1.1.
TEST(RecommendCut, standardCutsPredictANewPair) {
  CoefficientDatabase database("");
  fill(database, "a");
  const auto answer = recommendCut(database, queryOf("b", "aluminium"));
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->method, EstimationMethod::standard_cuts);
  EXPECT_NEAR(answer->set.value.ktc, 0.88e9, 1e-3 * 0.88e9);
  // Not more certain than three pairs with their own scatter allow.
  EXPECT_GT(answer->set.std_dev.ktc, 0.05 * 0.88e9);
  EXPECT_LT(answer->set.std_dev.ktc, 0.2 * 0.88e9);
}

TEST(RecommendCut, withoutCommonCutsOtherToolsAreUsed) {
  CoefficientDatabase database("");
  database.add(record("a", "steel", 2e9, 0.01));
  database.add(record("b", "aluminium", 0.8e9, 0.01));
  const auto answer = recommendCut(database, queryOf("b", "steel"));
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->method, EstimationMethod::other_tool);
  EXPECT_DOUBLE_EQ(answer->set.value.ktc, 2e9);
  EXPECT_GT(answer->set.std_dev.ktc, 0.1 * 2e9);
  EXPECT_TRUE(std::isnan(answer->disagreement));
  EXPECT_FALSE(recommendCut(database, queryOf("a", "brass")));
  EXPECT_THROW(recommendCut(database, queryOf("", "steel")), Error);
}

TEST(RecommendCut, theShearZonePredictsANewTool) {
  CoefficientDatabase database("");
  database.add(titanium("a", 0.0, 30.0));
  database.add(titanium("b", 6.0, 30.0));
  database.add(titanium("c", 12.0, 45.0));
  CoefficientQuery query = queryOf("new", "titanium");
  query.rake = radFromDeg(9.0);
  query.helix = radFromDeg(40.0);
  const auto answer = recommendCut(database, query);
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->method, EstimationMethod::shear_zone);
  const double truth = titanium("new", 9.0, 40.0).set.value.ktc;
  EXPECT_NEAR(answer->set.value.ktc, truth, 0.05 * truth);
  EXPECT_LT(answer->ktc_lower, truth);
  EXPECT_GT(answer->ktc_upper, truth);
}

TEST(RecommendCut, disagreeingMethodsIncreaseTheUncertainty) {
  CoefficientDatabase database("");
  fill(database, "a");
  const auto before = recommendCut(database, queryOf("b", "aluminium"));
  database.add(record("b", "aluminium", 1.6e9, 0.1));
  const auto after = recommendCut(database, queryOf("b", "aluminium"));
  ASSERT_TRUE(before && after);
  EXPECT_GT(after->disagreement, 2.0);
  EXPECT_GT(after->ktc_upper / after->ktc_lower, before->ktc_upper / before->ktc_lower);
  EXPECT_NE(after->message.find("other methods differ"), std::string::npos);
}

}  // namespace
}  // namespace smartmill::loadmeter
