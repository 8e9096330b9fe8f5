#include "smartmill_discrepancy/report/shop_quantity.h"

#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

ReportedTest cutAt(double rpm, double cut_time_before) {
  ReportedTest t;
  t.test.kind = TestKind::cut;
  t.test.spindle_speed = units::radPerSecFromRpm(rpm);
  t.test.cut_time_before = cut_time_before;
  t.test.engage_time = 0.5;
  t.duration = 1.0;
  return t;
}

TEST(ShopConditions, AreThoseOfTheFastestAndOfTheLastTest) {
  const ShopConditions conditions = conditionsOf({cutAt(12000.0, 60.0), cutAt(6000.0, 119.5)});
  EXPECT_NEAR(conditions.highest_speed, 400.0 * units::PI, 1e-9);
  EXPECT_NEAR(conditions.cutting_time, 120.0, 1e-12);
}

// Closed forms of what can be measured on the machine; the values of the keys follow.
TEST(ShopQuantities, AreWhatAShopMeasures) {
  const ShopConditions conditions{1000.0, 120.0};
  const auto first = [&](const char* effect, const std::vector<FoundParameter>& parameters) {
    return shopQuantities(effect, parameters, conditions).front();
  };
  const ShopQuantity indicator =
      first("runout", {{"offset_um", 20.0, 0.5, 0.0}, {"angle_deg", 90.0, 1.0, 0.0}});
  EXPECT_NEAR(indicator.value, 0.040, 1e-12);
  EXPECT_NEAR(indicator.std_dev, 0.001, 1e-12);
  EXPECT_EQ(indicator.unit, "mm");
  const ShopQuantity force =
      first("unbalance", {{"mass_eccentricity_g_mm", 10.0, 0.1, 0.0}, {"angle_deg", 0.0, 0.0, 0.0}});
  EXPECT_NEAR(force.value, 10.0, 1e-9);  // 10 g mm x (1000 rad/s)^2
  EXPECT_NEAR(force.std_dev, 0.1, 1e-9);
  EXPECT_EQ(force.unit, "N");
  const std::vector<ShopQuantity> wear =
      shopQuantities("tool_wear", {{"edge_growth_per_min", 0.5, 0.01, 0.0}}, conditions);
  EXPECT_NEAR(wear[0].value, 2.0, 1e-12);  // 1 + 0.5 / min x 2 min
  EXPECT_NEAR(wear[0].std_dev, 0.02, 1e-12);
  EXPECT_NEAR(wear[1].value, 2.0, 1e-12);  // [min]
  EXPECT_NEAR(wear[1].std_dev, 0.04, 1e-12);
  EXPECT_NEAR(first("feed_error", {{"ratio", 0.9, 0.01, 0.0}}).value, -10.0, 1e-12);
  EXPECT_NEAR(first("gain_error", {{"gain", 1.2, 0.01, 0.0}}).value, 20.0, 1e-12);
  EXPECT_NEAR(
      first("size_effect", {{"exponent", 1.0, 0.0, 0.0}, {"reference_chip_um", 50.0, 0.0, 0.0}}).value, 100.0,
      1e-12);
  EXPECT_NEAR(first("mass_loading", {{"mass_ratio", 3.0, 0.8, 0.0}}).value, 50.0, 1e-12);  // 1 / sqrt(4)
  EXPECT_NEAR(first("mass_loading", {{"mass_ratio", 3.0, 0.8, 0.0}}).std_dev, 5.0, 1e-12);
  EXPECT_NEAR(
      first("tooth_radius", {{"offset_um[0]", -9.0, 3.0, 0.0}, {"offset_um[1]", 9.0, 4.0, 0.0}}).value, 18.0,
      1e-12);
  EXPECT_NEAR(
      first("tooth_radius", {{"offset_um[0]", -9.0, 3.0, 0.0}, {"offset_um[1]", 9.0, 4.0, 0.0}}).std_dev, 5.0,
      1e-12);
}

TEST(ShopQuantities, NameEveryKeyInWords) {
  const auto last = [](const char* effect, const FoundParameter& p) {
    return shopQuantities(effect, {p}, {}).back();
  };
  EXPECT_EQ(last("uneven_pitch", {"pitch_deg[1]", 92.0, 0.1, 0.0}).name, "tooth 2: angle to the next tooth");
  const ShopQuantity mode = last("tool_flexibility", {"x[0].stiffness_n_per_um", 30.0, 1.0, 0.0});
  EXPECT_EQ(mode.name, "resonance along x: stiffness");
  EXPECT_EQ(mode.unit, "N/um");
  // As far as it is known.
  EXPECT_NEAR(last("runout", {"angle_deg", 350.0, 1.0, 90.0}).value, 80.0, 1e-12);
}

}  // namespace
}  // namespace smartmill::discrepancy
