#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_discrepancy/data/labels.h"
#include "smartmill_discrepancy/explain/explanation.h"

namespace smartmill::discrepancy {
namespace {

std::string campaigns() {
  const char* folder = std::getenv("SMARTMILL_SHARED");
  return std::string(folder ? folder : SMARTMILL_SHARED_FOLDER) + "/campaigns";
}

// Keeps the tests of these names.
Campaign only(Campaign campaign, const std::vector<std::string>& names) {
  std::vector<CampaignTest> kept;
  for (const CampaignTest& t : campaign.tests) {
    for (const std::string& n : names) {
      if (t.name == n) kept.push_back(t);
    }
  }
  campaign.tests = kept;
  return campaign;
}

Explanation explained(const std::string& name, const std::vector<std::string>& tests) {
  TemporaryFolder folder;
  const Campaign campaign = only(readCampaign(campaigns() + "/" + name), tests);
  const Dataset data = loadDataset(campaign, readMachineModel(campaign.modelPath()));
  return explain(data, {}, folder.file("."));
}

// A cause outside the catalogue in the records of another program: named unknown, at the right place. The
// truth of that program: a tone of 34.68 Hz and 8.72 N.
TEST(Explain, reportsAnUnknownToneWhereItIs) {
  if (!std::filesystem::exists(campaigns())) {
    std::cout << campaigns() << " is absent, not checked\n";
    return;
  }
  const Explanation e =
      explained("outside_catalogue", {"air_1000", "air_6000", "slot_1200", "slot_4500_100", "up_4500"});
  EXPECT_EQ(e.verdict, "unknown_effect");
  EXPECT_TRUE(e.effects.empty());
  ASSERT_FALSE(e.unexplained.empty());
  EXPECT_EQ(e.unexplained.front().channel, "fz");
  EXPECT_EQ(e.unexplained.front().domain, "frequency");
  // Records of 0.2 s tell lines 5 Hz apart; their amplitude tells the centre far better.
  EXPECT_NEAR(e.unexplained.front().location.at("frequency_hz"), 34.68, 0.3);
  EXPECT_NEAR(e.unexplained.front().amplitude, 8.72, 0.5);
}

TEST(Explain, namesStribeckFrictionWithinThreeStandardDeviations) {
  if (!std::filesystem::exists(campaigns())) {
    std::cout << campaigns() << " is absent, not checked\n";
    return;
  }
  const Explanation e = explained("stribeck_friction", {"air_1000", "air_3000", "air_6000", "air_12000"});
  ASSERT_EQ(e.effects.size(), 1u);
  EXPECT_EQ(e.effects.front().name, "stribeck_friction");
  EXPECT_EQ(e.verdict, "explained");
  for (const FoundParameter& p : e.effects.front().parameters) {
    // The truth is printed with four and five digits.
    const bool speed = p.key == "speed_rpm";
    EXPECT_NEAR(p.value, speed ? 2775.2 : 0.4557, 3.0 * p.std_dev + (speed ? 0.05 : 0.00005)) << p.key;
  }
  EXPECT_LE(e.after.fit, 1.05);
}

TEST(Labels, nameSwappedChannelsWrongSignsAndAnotherSpeed) {
  if (!std::filesystem::exists(campaigns())) {
    std::cout << campaigns() << " is absent, not checked\n";
    return;
  }
  const Campaign campaign =
      only(readCampaign(campaigns() + "/runout"), {"air_1000", "slot_3000", "slot_7200", "slot_4500_060"});
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

// Closed forms: chi-square with two degrees of freedom is exponential; Benjamini-Hochberg by hand.
TEST(Structure, countsLooksAsTextbooksDo) {
  EXPECT_NEAR(chiSquareTail(3.0, 2), std::exp(-1.5), 1e-12);
  EXPECT_NEAR(chiSquareTail(4.0, 4), std::exp(-2.0) * 3.0, 1e-12);
  EXPECT_GT(chiSquareTail(1e9, 2), 0.0);
  const std::vector<double> rates = falseDiscoveryRates({0.01, 0.04, 0.03, 0.5});
  EXPECT_NEAR(rates[0], 0.04, 1e-12);
  EXPECT_NEAR(rates[1], 0.16 / 3.0, 1e-12);
  EXPECT_NEAR(rates[2], 0.16 / 3.0, 1e-12);  // not above the next larger one
  EXPECT_NEAR(rates[3], 0.5, 1e-12);
}

// Noise of a known size beside lines and a drift that are far larger.
TEST(Noise, isFoundBetweenLines) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal(0.0, 0.7);
  std::vector<double> values;
  for (int i = 0; i < 8000; ++i)
    values.push_back(40.0 * std::sin(0.37 * i) + 9.0 * std::sin(2.2 * i) + 0.01 * i + normal(random));
  // Median of 2000 lines: 1.44 / sqrt(2000) in power, half of it in size; three of these.
  EXPECT_NEAR(noiseBetweenLines(values), 0.7, 0.7 * 0.05);
  EXPECT_THROW(noiseBetweenLines(std::vector<double>(10, 1.0)), Error);
}

// Conditions alone at the end of a range stay in the fit.
TEST(Heldout, liesInsideTheRangeOfTheFit) {
  std::vector<TestData> tests;
  for (const double feed : {0.025, 0.05, 0.075, 0.1, 0.125}) {
    TestData t;
    t.test.kind = TestKind::cut;
    t.test.spindle_speed = 600.0;
    t.test.engagement = Engagement{0.0, 3.14, 2e-3, feed * 1e-3};
    tests.push_back(t);
  }
  chooseHeldout(tests);
  EXPECT_FALSE(tests.front().heldout);
  EXPECT_FALSE(tests.back().heldout);
  EXPECT_EQ(tests[1].heldout + tests[2].heldout + tests[3].heldout, 2);
}

}  // namespace
}  // namespace smartmill::discrepancy
