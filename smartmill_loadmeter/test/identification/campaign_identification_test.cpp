#include "smartmill_loadmeter/identification/campaign_identification.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/testing/shared_data.h"
#include "smartmill_core/testing/sound_campaign.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {
namespace {

using ::testing::HasSubstr;
using units::radPerSecFromRpm;

const CuttingCoefficients TRUTH{953e6, 357e6, 188e6, 17.3e3, 17.7e3, 0.72e3};

// Load-meter records by small steps of the differential equation, with realistic rounding and noise.
struct Plant {
  MachineModel model;
  Campaign campaign;
  std::mt19937 random;
  double noise = 2e-4;

  Plant(const std::string& folder, unsigned seed, bool air) : random(seed) {
    model.file = folder + "/model.yaml";
    model.tool = ToolGeometry{3, 0.012, units::radFromDeg(35.0), {}};
    Spindle s;
    s.viscous = air ? 9e-4 : 4.743e-4;
    s.coulomb = air ? 0.5 : 0.0671;
    s.load_meter_gain = 3.88e-4;
    s.load_meter_bandwidth = 7.0;
    s.load_meter_resolution = 3e-4;
    model.spindle = s;
    campaign.folder = folder;
    campaign.model_file = "model.yaml";
    for (const double rpm : {2000.0, 6000.0, 12000.0}) {
      if (air) add("air_" + std::to_string(static_cast<int>(rpm)), rpm, 0.0);
    }
    for (const double feed : {3e-5, 6e-5, 1e-4}) {
      add("slot_" + std::to_string(static_cast<int>(feed * 1e6)), 6000.0, feed);
    }
  }

  void add(const std::string& name, double rpm, double feed) {
    CampaignTest test;
    test.name = name;
    test.file = name + ".csv";
    test.kind = feed > 0.0 ? TestKind::cut : TestKind::air;
    test.sample_rate = 5120.0;
    test.spindle_speed = radPerSecFromRpm(rpm);
    if (feed > 0.0) {
      test.engagement = Engagement{0.0, units::PI, 0.002, feed};
      test.engage_time = 0.0201;  // not on a sample
    }
    Record record;
    record.add("spindle_angle");
    record.add("load_meter");
    std::normal_distribution<double> normal;
    const double w = test.spindle_speed, tau = 1.0 / (units::TWO_PI * 7.0);
    const double idle = 4.743e-4 * w + 0.0671;
    double meter = 3.88e-4 * idle * w;
    const int steps = 20, n = 768;
    const Engagement e = test.engagement.value_or(Engagement{0.0, 1.0, 1e-3, 1e-5});
    const MechanisticForce force(*model.tool, TRUTH, e);
    for (int i = 0; i < n; ++i) {
      const double t = i / test.sample_rate;
      record.time.push_back(t);
      record.add("spindle_angle").push_back(std::fmod(1.0 + w * t, units::TWO_PI));
      record.add("load_meter").push_back(3e-4 * std::round((meter + noise * normal(random)) / 3e-4));
      for (int k = 0; k < steps; ++k) {
        const double dt = 1.0 / test.sample_rate / steps, at = t + (k + 0.5) * dt;
        const double torque =
            test.engage_time && at >= *test.engage_time ? force.at(1.0 + w * at).torque : 0.0;
        meter += dt / tau * (3.88e-4 * (idle + torque) * w - meter);
      }
    }
    writeCsv(record, campaign.folder + "/" + test.file);
    campaign.tests.push_back(test);
  }
};

TEST(LoadRecords, shortRecordsGiveTheTruthWithCalibratedStandardDeviations) {
  const TemporaryFolder folder;
  Coverage ktc, kte;
  for (int run = 0; run < Coverage::RUNS; ++run) {
    const Plant plant(folder.file(""), static_cast<unsigned>(run + 1), true);
    const CoefficientSet k = identifyFromLoadRecords(plant.campaign, plant.model, {}).set;
    EXPECT_NEAR(k.value.ktc, TRUTH.ktc, 0.005 * TRUTH.ktc);
    EXPECT_NEAR(k.value.kte, TRUTH.kte, 0.01 * TRUTH.kte);
    EXPECT_NEAR(k.friction_viscous, 4.743e-4, 0.01 * 4.743e-4);
    EXPECT_NEAR(k.friction_coulomb, 0.0671, 0.01);
    EXPECT_TRUE(std::isnan(k.value.kac));
    ktc.add(k.value.ktc - TRUTH.ktc, k.std_dev.ktc);
    kte.add(k.value.kte - TRUTH.kte, k.std_dev.kte);
  }
  EXPECT_TRUE(ktc.isCalibrated());
  EXPECT_TRUE(kte.isCalibrated());
}

TEST(LoadRecords, withoutAirCutsTheModelsFrictionIsUsed) {
  const TemporaryFolder folder;
  int inside = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const Plant plant(folder.file(""), seed, false);
    const CoefficientSet k = identifyFromLoadRecords(plant.campaign, plant.model, {}).set;
    EXPECT_NEAR(k.value.ktc, TRUTH.ktc, 0.005 * TRUTH.ktc);
    EXPECT_NEAR(k.value.kte, TRUTH.kte, 0.01 * TRUTH.kte);
    EXPECT_TRUE(std::isnan(k.friction_viscous));
    inside += std::abs(k.value.kte - TRUTH.kte) < 1.96 * k.std_dev.kte;
  }
  EXPECT_GE(inside, 16);  // 19 less three sigma of the count
}

TEST(LoadRecords, theSpindlesStatedUncertaintyIncreasesTheStandardDeviations) {
  const TemporaryFolder folder;
  Plant plant(folder.file(""), 1, true);
  plant.model.uncertainty.spindle = 3.0;
  // The lag differs by 2 % from the model, within its uncertainty, and is estimated from the transients.
  plant.model.spindle->load_meter_bandwidth = 7.0 * 1.02;
  LoadRecordOptions options;
  options.spindle_uncertainty = true;
  const LoadRecordResult k = identifyFromLoadRecords(plant.campaign, plant.model, options);
  EXPECT_NEAR(k.bandwidth, 7.0, 0.005 * 7.0);
  EXPECT_NEAR(k.set.value.ktc, TRUTH.ktc, 0.005 * TRUTH.ktc);
  // Only load_meter_v_per_w remains: 3 % of the value, common to both.
  EXPECT_NEAR(k.set.std_dev.ktc, 0.03 * TRUTH.ktc, 0.002 * TRUTH.ktc);
  EXPECT_NEAR(k.set.std_dev.kte, 0.03 * TRUTH.kte, 0.004 * TRUTH.kte);
  EXPECT_GT(k.covariance_tc_te / (k.set.std_dev.ktc * k.set.std_dev.kte), 0.95);
}

TEST(LoadRecords, aSlowerLoadMeterIsIdentified) {
  const TemporaryFolder folder;
  Plant plant(folder.file(""), 3, true);
  plant.model.spindle->load_meter_bandwidth = 9.0;
  const LoadRecordResult k = identifyFromLoadRecords(plant.campaign, plant.model, {});
  EXPECT_THAT(k.terms, ::testing::ElementsAre("load-meter lag"));
  EXPECT_NEAR(k.bandwidth, 7.0, 0.01 * 7.0);
  EXPECT_NEAR(k.set.value.ktc, TRUTH.ktc, 0.005 * TRUTH.ktc);
  EXPECT_TRUE(k.notes.empty());
  LoadRecordOptions plain;
  plain.choose_terms = false;
  const LoadRecordResult biased = identifyFromLoadRecords(plant.campaign, plant.model, plain);
  ASSERT_EQ(biased.notes.size(), 1u);
  EXPECT_THAT(biased.notes[0], HasSubstr("the records disagree"));
}

TEST(LoadRecords, missingTestsAreNamed) {
  const TemporaryFolder folder;
  Plant plant(folder.file(""), 1, true);
  const auto messageOf = [&] {
    return errorOf([&] { identifyFromLoadRecords(plant.campaign, plant.model, {}); });
  };
  plant.campaign.tests.pop_back();
  EXPECT_THAT(messageOf(), HasSubstr("2 cuts at 2 different feeds, expected three or more feeds"));
  plant.campaign.tests.erase(plant.campaign.tests.begin(), plant.campaign.tests.begin() + 2);
  EXPECT_THAT(messageOf(), HasSubstr("expected air cuts at two or more speeds, 1 usable"));
  plant.model.spindle.reset();
  EXPECT_THAT(messageOf(), HasSubstr("spindle is missing (needed to read the load meter)"));
}

TEST(MeasuredSlots, bothKindsOfMeansGiveThePublishedFigures) {
  SMARTMILL_SHARED_DATA(folder, "measured/slot_6000");
  const Campaign campaign = readCampaign(folder);
  const MachineModel model = readMachineModel(campaign.modelPath());
  const CuttingCoefficients all = identifyFromForceRecords(campaign, model, Means::all).value;
  const double printed = 5.1e-5;  // half a printed digit
  EXPECT_NEAR(all.ktc / 1e6, 958.8599, printed);
  EXPECT_NEAR(all.krc / 1e6, 250.8633, printed);
  EXPECT_NEAR(all.kac / 1e6, 146.3614, printed);
  EXPECT_NEAR(all.kte / 1e3, 15.7580, printed);
  EXPECT_NEAR(all.kre / 1e3, 19.4337, printed);
  EXPECT_NEAR(all.kae / 1e3, 18.2075, printed);
  const IdentifiedCoefficients whole = identifyFromForceRecords(campaign, model, Means::revolutions);
  EXPECT_NEAR(whole.value.krc / 1e6, 251.063, 5.1e-4);
  EXPECT_GT(whole.std_dev.krc, 0.0);
}

TEST(ExampleCampaign, forceAndLoadMeterFindTheModelsCoefficients) {
  SMARTMILL_SHARED_DATA(folder, "campaigns/none");
  const Campaign campaign = readCampaign(folder);
  MachineModel model = readMachineModel(campaign.modelPath());
  const CuttingCoefficients truth = *model.cutting;
  model.cutting.reset();
  const LoadRecordResult result = identifyFromLoadRecords(campaign, model, {});
  const CoefficientSet load = result.set;
  EXPECT_TRUE(result.notes.empty() && result.terms.empty());
  EXPECT_LT(load.std_dev.ktc, 1e-4 * truth.ktc);  // the information bound is about half of that
  EXPECT_NEAR(load.value.ktc, truth.ktc, 2e-3 * truth.ktc);
  EXPECT_NEAR(load.value.kte, truth.kte, 5e-3 * truth.kte);
  EXPECT_NEAR(load.value.ktc, truth.ktc, 4.0 * load.std_dev.ktc);
  EXPECT_NEAR(load.value.kte, truth.kte, 4.0 * load.std_dev.kte);
  const IdentifiedCoefficients force = identifyFromForceRecords(campaign, model, Means::revolutions);
  EXPECT_NEAR(force.value.ktc, truth.ktc, 4.0 * force.std_dev.ktc);
  EXPECT_NEAR(force.value.krc, truth.krc, 4.0 * force.std_dev.krc);
  EXPECT_NEAR(force.value.kac, truth.kac, 4.0 * force.std_dev.kac);
  EXPECT_NEAR(force.value.kte, truth.kte, 4.0 * force.std_dev.kte);
}

struct CampaignCase {
  const char* name;
  std::vector<std::string> terms;
};

TEST(ExampleCampaigns, hiddenFrictionWearAndRunoutAreIdentified) {
  const std::vector<CampaignCase> cases{{"cross_talk", {}},
                                        {"outside_catalogue", {}},
                                        {"runout", {"runout"}},
                                        {"stribeck_friction", {"Stribeck friction"}},
                                        {"tool_wear_and_unbalance", {"edge growth"}}};
  SMARTMILL_SHARED_DATA(folder, "campaigns");
  for (const CampaignCase& c : cases) {
    const Campaign campaign = readCampaign(folder + "/" + c.name);
    const MachineModel model = readMachineModel(campaign.modelPath());
    const LoadRecordResult k = identifyFromLoadRecords(campaign, model, {});
    EXPECT_EQ(k.terms, c.terms) << c.name;
    EXPECT_TRUE(k.notes.empty()) << c.name;
    EXPECT_NEAR(k.set.value.ktc, model.cutting->ktc, 2e-3 * model.cutting->ktc) << c.name;
    EXPECT_NEAR(k.set.value.kte, model.cutting->kte, 5e-3 * model.cutting->kte) << c.name;
    EXPECT_LT(k.set.std_dev.ktc, 3e-4 * model.cutting->ktc) << c.name;
    EXPECT_NEAR(k.set.value.kte, model.cutting->kte, 4.0 * k.set.std_dev.kte) << c.name;
    if (c.terms == std::vector<std::string>{"runout"}) {
      EXPECT_NEAR(k.runout, 21.08e-6, 0.1e-6);
      EXPECT_NEAR(units::degFromRad(k.runout_angle), 261.8, 0.5);
    }
    EXPECT_NEAR(k.set.value.ktc, model.cutting->ktc, 4.0 * k.set.std_dev.ktc) << c.name;
  }
  const Campaign stribeck = readCampaign(folder + "/stribeck_friction");
  const LoadRecordResult s = identifyFromLoadRecords(stribeck, readMachineModel(stribeck.modelPath()), {});
  EXPECT_NEAR(s.friction.breakaway, 0.4557, 1e-3);
  EXPECT_NEAR(units::rpmFromRadPerSec(s.friction.stribeck_speed), 2775.2, 5.0);
  const Campaign wear = readCampaign(folder + "/tool_wear_and_unbalance");
  const LoadRecordResult w = identifyFromLoadRecords(wear, readMachineModel(wear.modelPath()), {});
  EXPECT_NEAR(60.0 * w.edge_growth, 0.4194, 0.002);
}

// The same cuts as WAV files with named channels and scales: 24 bits round to a thousandth of the noise.
TEST(ForceRecords, SoundFilesGiveTheSameCoefficients) {
  SMARTMILL_SHARED_DATA(folder, "campaigns/none");
  Campaign campaign = readCampaign(folder);
  const auto few = [](const CampaignTest& t) {
    return t.name == "slot_4500_030" || t.name == "slot_4500_060" || t.name == "slot_4500_100";
  };
  const TemporaryFolder wav;
  const Campaign sound = asSoundFiles(campaign, wav.file(""), few);
  campaign.tests.erase(std::remove_if(campaign.tests.begin(), campaign.tests.end(),
                                      [&](const CampaignTest& t) { return !few(t); }),
                       campaign.tests.end());
  const MachineModel model = readMachineModel(campaign.modelPath());
  const CuttingCoefficients expected = identifyFromForceRecords(campaign, model, Means::all).value,
                            found = identifyFromForceRecords(sound, model, Means::all).value;
  for (const CuttingKey& k : cuttingKeys())
    EXPECT_NEAR(found.*k.coefficient, expected.*k.coefficient, 1e-4 * std::abs(expected.*k.coefficient))
        << k.key;
}

}  // namespace
}  // namespace smartmill::loadmeter
