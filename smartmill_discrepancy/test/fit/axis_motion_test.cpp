// A dynamometer on a table that moves without any contact: every force is
// inertia (37.0 to 37.3 kg by regression of the force on the acceleration,
// README of the data).

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include <gtest/gtest.h>

#include "smartmill_core/testing/shared_data.h"
#include "smartmill_discrepancy/data/dataset.h"
#include "smartmill_discrepancy/fit/fit.h"
#include "smartmill_discrepancy/gap/gap.h"
#include "smartmill_discrepancy/hypotheses/hypothesis.h"

namespace smartmill::discrepancy {
namespace {

constexpr double FORCE_IS_LATE = 0.1878;  // [s] by the best correlation with the acceleration

Dataset movesOf(const std::string& folder, std::optional<double> force_offset) {
  Campaign campaign = readCampaign(folder);
  if (force_offset) {
    for (CampaignTest& test : campaign.tests) test.stream_offset["force"] = *force_offset;
  }
  return loadDataset(campaign, readMachineModel(campaign.modelPath()));
}

const Hypothesis& inertiaOf(const std::vector<Hypothesis>& hypotheses, const std::string& axis) {
  return *std::find_if(hypotheses.begin(), hypotheses.end(),
                       [&](const Hypothesis& h) { return h.effect == "axis_inertia" && h.variant == axis; });
}

double massIn(const Dataset& data, const Hypothesis& inertia) {
  MachineModel certain = data.nominal;
  certain.uncertainty = {0.0, 0.0, 0.0, 0.0, 0.0};
  const NominalFreedom freedom(certain);
  const TwinRunner runner(data, {0, 1, 2, 3}, 2, 1);
  FitState start;
  start.nominal.assign(freedom.coordinates().size(), 0.0);
  start.members.push_back({&inertia, {1.0}});
  const FitResult fit = Fitter(runner, freedom).fit(start, nullptr, {30, 1e-10});
  EXPECT_TRUE(fit.converged);
  return fit.state.members.front().values.front();
}

double residualRms(const CampaignGap& gap, const std::string& channel) {
  double squares = 0.0;
  for (const ChannelGap& g : gap.channels)
    squares += g.channel == channel ? g.residual_rms * g.residual_rms : 0.0;
  return std::sqrt(squares / 4.0);
}

TEST(AxisMotion, theMassOfTheTableIsFoundAndTheGapFalls) {
  SMARTMILL_SHARED_DATA(folder, "measured/axis_motion");
  const Dataset data = movesOf(folder, FORCE_IS_LATE);
  ASSERT_EQ(data.tests.size(), 4u);
  EXPECT_EQ(data.tests[0].channels, (std::vector<std::string>{"fx", "fy", "fz"}));
  EXPECT_EQ(data.tests[0].record.size(), 29250u - 1878u);
  const std::vector<Hypothesis> hypotheses = catalogueHypotheses(data, nullptr);
  const Hypothesis inertia = inertiaOf(hypotheses, "x");
  const double mass = massIn(data, inertia);
  EXPECT_NEAR(mass, 37.3, 0.5);
  MachineModel model = data.nominal;
  model.effects = {inertia.entry({mass})};
  const CampaignGap before = campaignGap(data, data.nominal, 2), after = campaignGap(data, model, 2);
  EXPECT_LT(after.overall, 0.7 * before.overall);
  EXPECT_NEAR(residualRms(before, "fx"), 8.6, 0.2);
  EXPECT_LT(residualRms(after, "fx"), 0.3 * residualRms(before, "fx"));
  EXPECT_DOUBLE_EQ(residualRms(after, "fy"), residualRms(before, "fy"));
}

// Where the campaign states no offset, it is found from the records.
TEST(AxisMotion, theOffsetIsFoundWhereItIsNotStated) {
  SMARTMILL_SHARED_DATA(folder, "measured/axis_motion");
  const Dataset data = movesOf(folder, {});
  const std::vector<Hypothesis> hypotheses = catalogueHypotheses(data, nullptr);
  EXPECT_NEAR(massIn(data, inertiaOf(hypotheses, "x")), 37.3, 0.5);
  ASSERT_EQ(data.stream_shifts.size(), 1u);
  EXPECT_NE(data.stream_shifts[0].find("forces are recorded 0.18"), std::string::npos);
}

// By the stated offset of zero force and acceleration are nearly uncorrelated.
TEST(AxisMotion, withoutTheOffsetThereIsNoMass) {
  SMARTMILL_SHARED_DATA(folder, "measured/axis_motion");
  const Dataset data = movesOf(folder, 0.0);
  const std::vector<Hypothesis> hypotheses = catalogueHypotheses(data, nullptr);
  EXPECT_LT(massIn(data, inertiaOf(hypotheses, "x")), 0.5 * 37.3);
}

}  // namespace
}  // namespace smartmill::discrepancy
