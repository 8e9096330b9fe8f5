// A force over the revolution put into slots of many feeds by hand, and the table that is found of it.
#include "smartmill_discrepancy/explain/revolution.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_discrepancy/search/workbench.h"

#include "explain/small_campaign.h"

namespace smartmill::discrepancy {
namespace {

constexpr double LARGEST = 0.105;  // [mm]
constexpr int ORDERS = 9;

// Of order k: 1.5 N, late by 0.7 k^2, always; 2.5 N at the largest feed, early by 0.4 k^2, growing with the
// feed.
double overTheTurn(const CampaignTest& test, double angle) {
  double force = 0.0;
  for (int k = 1; k <= ORDERS; ++k)
    force += 1.5 * std::cos(k * angle - 0.7 * k * k) + 2.5 * test.engagement->feed_per_tooth /
                                                           (LARGEST * units::MM) *
                                                           std::cos(k * angle + 0.4 * k * k);
  return force;
}

Dataset slotsAt(const std::vector<CampaignTest>& tests, const std::string& folder) {
  Campaign campaign;
  campaign.folder = folder;
  campaign.model_file = "model.yaml";
  campaign.tests = tests;
  writeMachineModel(believed(), folder + "/model.yaml");
  writeCampaign(campaign, folder);
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  sim::SimulationOptions options;
  options.substeps = 8;
  options.noise = false;
  for (const CampaignTest& test : campaign.tests) {
    Record record = sim::simulateTest(believed(), test, 0.15, options);
    std::vector<double>& fy = record.add("fy");
    for (std::size_t i = 0; i < fy.size(); ++i) {
      if (record.time[i] >= *test.engage_time) fy[i] += overTheTurn(test, record.column("spindle_angle")[i]);
    }
    for (const char* c : {"fx", "fy", "fz"}) {
      for (double& f : record.add(c)) f += normal(random);
    }
    writeCsv(record, folder + "/" + test.file);
  }
  return loadDataset(campaign, readMachineModel(campaign.modelPath()));
}

std::optional<Hypothesis> tableOf(const Dataset& data) {
  Workbench bench(data, {});
  FitState nominal;
  nominal.nominal.assign(bench.freedom().coordinates().size(), 0.0);
  const NominalTangents tangents = bench.linearise(nominal);
  const Fit here = bench.quick().fit(nominal, &tangents, {0, 1e-8, true});
  return revolutionLeft(bench.quick().runner(), empiricalHypotheses(bench.data()), here);
}

TEST(Revolution, theTableIsWhatWasAdded) {
  const TemporaryFolder folder;
  std::vector<CampaignTest> tests;
  for (const double feed : {0.03, 0.045, 0.06, 0.075, 0.09, LARGEST})
    tests.push_back(slot("f" + std::to_string(tests.size()), 4500, feed, 90.0));
  const auto table = tableOf(slotsAt(tests, folder.file(".")));
  ASSERT_TRUE(table);
  const EffectEntry entry = table->entry({1.0});
  EXPECT_NEAR(entry.numbers.at("speed_rpm"), 4500.0, 1.0);
  EXPECT_NEAR(entry.numbers.at("depth_mm"), 2.0, 1e-9);
  EXPECT_NEAR(entry.numbers.at("chip_um"), 1e3 * LARGEST, 1e-6);
  const std::vector<double>& order = entry.lists.at("order");
  ASSERT_EQ(order.size(), static_cast<std::size_t>(ORDERS));
  // Noise of 1 N in some 1400 samples of each of four cuts or more; feeds from 0.3 to 1 of the largest.
  constexpr double NEAR = 5.0 * 0.08;
  for (std::size_t k = 0; k < order.size(); ++k) {
    const double o = order[k];
    EXPECT_EQ(o, static_cast<double>(k + 1));
    const double* const y = &entry.lists.at("fy_n")[4 * k];
    EXPECT_NEAR(y[0], 1.5 * std::cos(0.7 * o * o), NEAR) << o;
    EXPECT_NEAR(y[1], 1.5 * std::sin(0.7 * o * o), NEAR) << o;
    EXPECT_NEAR(y[2], 2.5 * std::cos(0.4 * o * o), NEAR) << o;
    EXPECT_NEAR(y[3], -2.5 * std::sin(0.4 * o * o), NEAR) << o;
    for (std::size_t part = 0; part < 4; ++part)
      EXPECT_NEAR(entry.lists.at("fx_n")[4 * k + part], 0.0, NEAR) << o;
  }
}

TEST(Revolution, noTableWhereCutsDifferInMoreThanTheFeed) {
  const TemporaryFolder folder;
  EXPECT_FALSE(tableOf(slotsAt(slotsOfManyKinds(), folder.file("."))));
}

}  // namespace
}  // namespace smartmill::discrepancy
