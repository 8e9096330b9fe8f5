#include "smartmill_discrepancy/data/labels.h"

#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/testing/shared_data.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {
namespace {

TEST(Labels, NameSwappedChannelsWrongSignsAndWrongSpeed) {
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

  Dataset inverted = data;
  for (TestData& t : inverted.tests) {
    for (const char* channel : {"fx", "fz"}) {
      for (double& v : t.record.add(channel)) v = -v;
    }
  }
  ASSERT_EQ(checkLabels(inverted, 2).wrong.size(), 1u);
  EXPECT_EQ(checkLabels(inverted, 2).wrong.front(),
            "fx, fz have the opposite sign of the simulation: sign or force_sensor.measures looks wrong");

  Dataset speed = data;
  speed.tests[2].test.spindle_speed *= 1.25;
  ASSERT_EQ(checkLabels(speed, 2).wrong.size(), 1u);
}

// A wrong feed label is doubtful with any model. A nonlinear law, with which a high feed has the force of a
// lower one, is doubtful with the nominal model only.
TEST(Labels, AreNotDoubtfulWithAModelThatHasTheCause) {
  SMARTMILL_SHARED_DATA(folder, "campaigns/none");
  const Campaign campaign = readCampaign(folder);
  const Dataset data = loadDataset(campaign, readMachineModel(campaign.modelPath()));
  MachineModel bent = data.nominal;
  bent.effects = {effectEntry("empirical:chip_thickness", {}, {},
                              {{"h_um", {30.0, 60.0, 100.0}}, {"factor", {1.0, 0.75, 0.55}}})};
  Dataset machine = data, relabelled = data;
  std::size_t again = 0, high = 0;
  for (std::size_t i = 0; i < data.tests.size(); ++i) {
    sim::SimulationOptions options;
    options.noise = false;
    machine.tests[i].record = sim::simulateTest(bent, data.tests[i].test, data.tests[i].record, options);
    if (data.tests[i].test.name == "slot_4500_again") again = i;
    if (data.tests[i].test.name == "slot_4500_100") high = i;
  }
  const std::vector<std::string> doubtful = checkLabels(machine, 2).doubtful;
  ASSERT_EQ(doubtful.size(), 1u);
  EXPECT_EQ(doubtful.front(),
            "test slot_4500_100 looks mislabelled: feed, depth or immersion of slot_4500_060 fit its record");
  EXPECT_EQ(doubtfulLabels(data.nominal, machine, 2), doubtful);
  EXPECT_TRUE(doubtfulLabels(bent, machine, 2).empty());
  relabelled.tests[again].test.engagement = data.tests[high].test.engagement;
  const std::vector<std::string> wrong = checkLabels(relabelled, 2).doubtful;
  ASSERT_EQ(wrong.size(), 1u);
  EXPECT_NE(wrong.front().find("slot_4500_again looks mislabelled"), std::string::npos) << wrong.front();
  EXPECT_EQ(doubtfulLabels(data.nominal, relabelled, 2), wrong);
}

}  // namespace
}  // namespace smartmill::discrepancy
