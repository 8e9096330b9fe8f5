#include "smartmill_discrepancy/data/labels.h"

#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/testing/shared_data.h"

namespace smartmill::discrepancy {
namespace {

TEST(Labels, nameSwappedChannelsWrongSignsAndAnotherSpeed) {
  SMARTMILL_SHARED_DATA(folder, "campaigns/runout");
  Campaign campaign = readCampaign(folder);
  const std::set<std::string> kept{"air_1000", "slot_3000", "slot_7200", "slot_4500_060"};
  campaign.tests.erase(std::remove_if(campaign.tests.begin(), campaign.tests.end(),
                                      [&](const CampaignTest& t) { return kept.count(t.name) == 0; }),
                       campaign.tests.end());
  const Dataset data = loadDataset(campaign, readMachineModel(campaign.modelPath()));
  EXPECT_TRUE(checkLabels(data, 2).wrong.empty());
  EXPECT_TRUE(checkLabels(data, 2).doubtful.empty());

  Dataset swapped = data;
  Record& record = swapped.tests[2].record;
  std::swap(record.add("fx"), record.add("fy"));
  const std::vector<std::string> wrong = checkLabels(swapped, 2).wrong;
  ASSERT_EQ(wrong.size(), 1u);
  EXPECT_EQ(wrong.front(), "fx and fy look swapped in tests " + swapped.tests[2].test.name);

  Dataset turned = data;
  for (TestData& t : turned.tests) {
    for (const char* channel : {"fx", "fz"}) {
      for (double& v : t.record.add(channel)) v = -v;
    }
  }
  ASSERT_EQ(checkLabels(turned, 2).wrong.size(), 1u);
  EXPECT_EQ(checkLabels(turned, 2).wrong.front(),
            "fx, fz read minus what the model says: sign or force_sensor.measures looks wrong");

  Dataset speed = data;
  speed.tests[2].test.spindle_speed *= 1.25;
  ASSERT_EQ(checkLabels(speed, 2).wrong.size(), 1u);
}

}  // namespace
}  // namespace smartmill::discrepancy
