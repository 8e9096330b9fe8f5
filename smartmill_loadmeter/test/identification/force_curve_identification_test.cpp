#include "smartmill_loadmeter/identification/force_curve_identification.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "../cut_simulator.h"

namespace smartmill::loadmeter {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(ForceCurveIdentification, IdentifiesTheLawForAnyHeading) {
  for (const double heading : {0.0, 2.1}) {
    ForceCurveIdentification identification({});
    std::vector<IdentifiedForceCurves> found;
    identification.onCurves([&](const IdentifiedForceCurves& f) { found.push_back(f); });
    CutSimulator shop([&](const auto& input) { identification.handle(input); });
    shop.heading = heading;
    for (const double feed : {5e-5, 1e-4, 2e-4}) shop.cut("feed " + std::to_string(found.size()), feed);
    shop.end();
    ASSERT_EQ(found.size(), 3u);
    EXPECT_THAT(found.back().cuts, ElementsAre("feed 0", "feed 0", "feed 1"));
    EXPECT_EQ(found.back().teeth, 2);
    const ForceCurves& curves = found.back().curves;
    EXPECT_NEAR(curves.tangential.knots.back(), 2e-4, 1e-12);
    for (const double h : {4e-5, 8e-5, 1.2e-4, 1.6e-4, 1.9e-4}) {
      EXPECT_NEAR(curves.tangential.at(h), KTC * h + KTE, 0.01 * (KTC * h + KTE)) << h << " " << heading;
      EXPECT_NEAR(curves.radial.at(h), KRC * h + KRE, 0.01 * (KTC * h + KTE)) << h << " " << heading;
    }
  }
}

TEST(ForceCurveIdentification, RejectsChatterAndShortCuts) {
  ForceCurveIdentification identification({});
  int found = 0;
  std::vector<std::string> rejected;
  identification.onCurves([&](const IdentifiedForceCurves&) { ++found; });
  identification.onRejected([&](const std::string& why) { rejected.push_back(why); });
  CutSimulator shop([&](const auto& input) { identification.handle(input); });
  shop.vibration = 400.0;
  shop.cut("loud", 1e-4);
  shop.vibration = 0.0;
  shop.cut("short", 1e-4, 0.3);
  shop.end();
  EXPECT_EQ(found, 0);
  ASSERT_EQ(rejected.size(), 2u);
  EXPECT_THAT(rejected[0], HasSubstr("'loud': "));
  EXPECT_THAT(rejected[0], HasSubstr("not synchronous with the spindle"));
  EXPECT_THAT(rejected[1], HasSubstr("'short': "));
}

}  // namespace
}  // namespace smartmill::loadmeter
