#include "smartmill_discrepancy/gap/gap.h"

#include <algorithm>
#include <string>

#include <gtest/gtest.h>

#include "smartmill_core/testing/shared_data.h"

namespace smartmill::discrepancy {
namespace {

double largestOf(const CampaignGap& gap, const std::string& channel) {
  double largest = 0.0;
  for (const ChannelGap& row : gap.channels) {
    if (row.channel == channel) largest = std::max(largest, row.gap);
  }
  return largest;
}

// Independent campaigns: one whose model is exact, others with a hidden effect in the channels named.
TEST(Gap, IsTheNoiseFloorOnlyWithoutHiddenEffects) {
  SMARTMILL_SHARED_DATA(campaigns, "campaigns");
  const auto load = [&](const std::string& name) {
    const Campaign campaign = readCampaign(campaigns + "/" + name);
    return loadDataset(campaign, readMachineModel(campaign.modelPath()));
  };
  const auto gapOf = [&](const std::string& name) {
    const Dataset data = load(name);
    return campaignGap(data, data.nominal, 2);
  };
  const CampaignGap none = gapOf("none");
  for (const char* channel : {"fx", "fy", "fz", "load_meter"})
    EXPECT_LE(largestOf(none, channel), 1.05) << channel;
  EXPECT_NEAR(none.overall, 1.0, 0.01);
  EXPECT_NEAR(load("none").noise.at("load_meter"), 2.2e-4, 0.1e-4);  // as stated in the campaigns' README

  const CampaignGap friction = gapOf("stribeck_friction");
  EXPECT_GT(largestOf(friction, "load_meter"), 2.0);
  EXPECT_LE(largestOf(friction, "fx"), 1.05);
  const CampaignGap runout = gapOf("runout");
  EXPECT_GT(largestOf(runout, "fx"), 2.0);
  EXPECT_GT(largestOf(runout, "fy"), 2.0);
}

}  // namespace
}  // namespace smartmill::discrepancy
