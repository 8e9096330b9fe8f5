#include "smartmill_loadmeter/identification/force_law.h"
#include "smartmill_loadmeter/identification/slot_fit.h"

#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/testing/shared_data.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {
namespace {

using ::testing::HasSubstr;

TEST(ForcePoints, transformForcesBackIntoTheLaw) {
  // Down milling with one tooth in cut, as Bachrathy & Stepan: 12 mm, 2 teeth, 6 mm wide.
  const ToolGeometry tool{2, 0.012, 0.0, {}};
  const CuttingCoefficients k{800e6, 300e6, 0, 12e3, 9e3, 0};
  const Engagement e{units::PI / 2, units::PI, 0.002, 2e-4};
  const MechanisticForce force(tool, k, e);
  std::vector<double> fx, fy, angle;
  for (int i = 0; i < 720; ++i) {
    angle.push_back(units::radFromDeg(0.5 * i + 0.1));
    const CuttingForce f = force.at(angle.back());
    fx.push_back(f.fx);
    fy.push_back(f.fy);
  }
  const std::vector<ForcePoint> points = forcePoints(fx, fy, angle, tool, e);
  EXPECT_EQ(points.size(), 360u);
  for (const ForcePoint& p : points) {
    EXPECT_NEAR(p.tangential, k.ktc * p.chip + k.kte, 1e-6 * k.kte);
    EXPECT_NEAR(p.radial, k.krc * p.chip + k.kre, 1e-6 * k.kre);
  }
  // Four teeth in a slot: always two in cut.
  const ToolGeometry four{4, 0.012, 0.0, {}};
  EXPECT_THAT(errorOf([&] {
                forcePoints(fx, fy, angle, four, {0.0, units::PI, 0.002, 1e-4});
              }),
              HasSubstr("expected angles with one tooth in cut"));
}

std::vector<double> chips() {
  std::vector<double> chip;
  for (int i = 1; i <= 200; ++i) chip.push_back(1e-6 * i);
  return chip;
}

TEST(ForceLaws, theEvidenceSelectsTheTrueLaw) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  const std::vector<double> chip = chips();
  const auto noisy = [&](auto law) {
    std::vector<double> force;
    for (const double h : chip) force.push_back(law(h) + 1e3 * normal(random));
    return force;
  };
  const auto linear = fitForceLaws(chip, noisy([](double h) { return 800e6 * h + 15e3; }));
  EXPECT_EQ(linear.front().kind, ForceLawKind::linear);
  EXPECT_NEAR(linear.front().value[0], 800e6, 3.0 * linear.front().std_dev[0]);
  const auto power = fitForceLaws(chip, noisy([](double h) { return 90e3 * std::pow(h / 1e-4, 0.7); }));
  EXPECT_EQ(power.front().kind, ForceLawKind::power);
  EXPECT_NEAR(power.front().value[1], 0.7, 3.0 * power.front().std_dev[1]);
  const auto shifted =
      fitForceLaws(chip, noisy([](double h) { return h > 4e-5 ? 500e6 * h + 30e3 : 1250e6 * h; }));
  EXPECT_EQ(shifted.front().kind, ForceLawKind::shifted_linear);
  EXPECT_NEAR(shifted.front().value[2], 4e-5, 3e-6);
  EXPECT_GT(linear.back().bic, linear.front().bic + 10.0);
}

TEST(Slots, runoutIsFoundInTheExampleCampaign) {
  SMARTMILL_SHARED_DATA(folder, "campaigns/runout");
  Campaign campaign = readCampaign(folder);
  std::vector<CampaignTest> few;
  for (const CampaignTest& t : campaign.tests) {
    if (t.name == "slot_4500_060" || t.name == "slot_4500_100" || t.name == "slot_1200") few.push_back(t);
  }
  campaign.tests = few;
  const MachineModel model = readMachineModel(campaign.modelPath());
  const SlotFitResult best = fitSlots(campaign, model).front();
  EXPECT_THAT(best.name, HasSubstr("runout"));
  EXPECT_NEAR(best.offset, 21.08e-6, 2.5e-6);  // the sensor's modes amplify the first orders by a few percent
  EXPECT_NEAR(best.value.ktc, model.cutting->ktc, 0.06 * model.cutting->ktc);
}

TEST(Slots, measuredSlotsPreferARotatingTerm) {
  SMARTMILL_SHARED_DATA(folder, "measured/slot_6000");
  Campaign campaign = readCampaign(folder);
  campaign.tests.erase(campaign.tests.begin() + 1, campaign.tests.begin() + 3);
  const std::vector<SlotFitResult> fits = fitSlots(campaign, readMachineModel(campaign.modelPath()));
  EXPECT_TRUE(fits.front().offset > 0.0 || fits.front().unbalance > 0.0);
  double plain = 0.0;
  for (const SlotFitResult& f : fits) {
    if (f.name == "linear edge forces") plain = f.bic;
  }
  EXPECT_GT(plain - fits.front().bic, 20.0);
}

}  // namespace
}  // namespace smartmill::loadmeter
