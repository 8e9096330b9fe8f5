// A force over the revolution, added to slots of many feeds, and the identified table.
#include "smartmill_discrepancy/explain/revolution_table.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_discrepancy/explain/nonlinear_chip_law.h"
#include "smartmill_discrepancy/search/workbench.h"

#include "explain/small_campaign.h"

namespace smartmill::discrepancy {
namespace {

constexpr double LARGEST = 0.105;  // [mm]
constexpr int ORDERS = 9;

// Forces of one machine, and axial force of another.
struct Forces {
  MachineModel machine = believed();
  MachineModel axial = machine;
};

// Order k: constant part of 1.5 N with phase lag 0.7 k^2; part of 2.5 N at the largest feed, proportional to
// the feed, with phase lead 0.4 k^2.
double addedForce(const CampaignTest& test, double angle) {
  double force = 0.0;
  for (int k = 1; k <= ORDERS; ++k)
    force += 1.5 * std::cos(k * angle - 0.7 * k * k) + 2.5 * test.engagement->feed_per_tooth /
                                                           (LARGEST * units::MM) *
                                                           std::cos(k * angle + 0.4 * k * k);
  return force;
}

Dataset slotsAt(const std::vector<CampaignTest>& tests, const std::string& folder, const Forces& forces = {},
                double added_share = 1.0) {
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  sim::SimulationOptions options;
  options.substeps = 8;
  options.noise = false;
  const auto recordOf = [&](const CampaignTest& test, std::uint64_t) {
    Record record = sim::simulateTest(forces.machine, test, 0.15, options);
    record.add("fz") = sim::simulateTest(forces.axial, test, 0.15, options).column("fz");
    std::vector<double>& fy = record.add("fy");
    for (std::size_t i = 0; i < fy.size(); ++i) {
      if (record.time[i] >= *test.engage_time)
        fy[i] += added_share * addedForce(test, record.column("spindle_angle")[i]);
    }
    for (const char* c : {"fx", "fy", "fz"}) {
      for (double& f : record.add(c)) f += normal(random);
    }
    return record;
  };
  return datasetOf(recordOf, folder, tests);
}

std::optional<Hypothesis> tableOf(const Dataset& data) {
  Workbench bench(data, {});
  FitState nominal;
  nominal.nominal.assign(bench.freedom().coordinates().size(), 0.0);
  const NominalTangents tangents = bench.linearise(nominal);
  const FitResult here = bench.quick().fit(nominal, &tangents, {0, 1e-8});
  return revolutionTable(bench.quick().runner(), empiricalHypotheses(bench.data()), here);
}

TEST(RevolutionTable, IsTheAddedForce) {
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
  // Noise of 1 N in some 1400 samples of at least four cuts; feeds from 0.3 to 1 of the largest.
  constexpr double NEAR = 5.0 * 0.08;
  for (std::size_t k = 0; k < order.size(); ++k) {
    const double o = order[k];
    EXPECT_EQ(o, static_cast<double>(k + 1));
    const double* const y = &entry.lists.at("fy_n")[4 * k];
    EXPECT_NEAR(y[0], 1.5 * std::cos(0.7 * o * o), NEAR) << o;
    EXPECT_NEAR(y[1], 1.5 * std::sin(0.7 * o * o), NEAR) << o;
    EXPECT_NEAR(y[2], 2.5 * std::cos(0.4 * o * o), NEAR) << o;
    EXPECT_NEAR(y[3], -2.5 * std::sin(0.4 * o * o), NEAR) << o;
    for (std::size_t component = 0; component < 4; ++component)
      EXPECT_NEAR(entry.lists.at("fx_n")[4 * k + component], 0.0, NEAR) << o;
  }
}

const std::vector<double> FEEDS{0.03, 0.045, 0.06, 0.075, 0.09, LARGEST};

std::optional<NonlinearChipLaw> lawOf(const Forces& forces) {
  const TemporaryFolder folder;
  std::vector<CampaignTest> tests;
  for (const double feed : FEEDS) tests.push_back(slot("f" + std::to_string(tests.size()), 4500, feed, 90.0));
  const Dataset data = slotsAt(tests, folder.file("."), forces, 0.0);
  const Workbench bench(data, {});
  const TwinRunner& runner = bench.quick().runner();
  return identifyChipLaw(runner, cutsOfVaryingFeed(runner), data.nominal, data.nominal);
}

// A chip force proportional to h^0.7 behind sensor gains of 1.5 in x and 0.8 in y: the law is identified
// independently of the gains.
TEST(NonlinearChipLaw, IsIdentifiedThroughAnUnknownSensor) {
  MachineModel machine = believed();
  machine.effects = {effectEntry("size_effect", {{"exponent", 0.3}, {"reference_chip_um", 60.0}}),
                     effectEntry("gain_error", {{"gain", 1.5}}, {{"channel", "fx"}}),
                     effectEntry("gain_error", {{"gain", 0.8}}, {{"channel", "fy"}})};
  const auto law = lawOf({machine});
  ASSERT_TRUE(law);
  EXPECT_TRUE(law->isNonlinear());
  EXPECT_NEAR(law->in_plane.exponent, 0.3, 0.1);
  EXPECT_EQ(law->axial.exponent, law->in_plane.exponent);
  EXPECT_LT(law->squares, 0.2 * law->linear_squares);
  // Zero at the ends; the mean of fy, proportional to the feed^0.7, is above its chord in between.
  const auto level = [&](double chip) { return law->curvature.at(0.0, "fy", chip)[0]; };
  EXPECT_EQ(level(law->curvature.chips.front()), 0.0);
  EXPECT_GT(level(0.06e-3), 1.0);
}

// The axial force is linear in the chip thickness, the others are not.
TEST(NonlinearChipLaw, CanDifferForTheAxialForce) {
  MachineModel machine = believed();
  machine.effects = {effectEntry("size_effect", {{"exponent", 0.3}, {"reference_chip_um", 60.0}})};
  const auto law = lawOf({machine, believed()});
  ASSERT_TRUE(law);
  EXPECT_NEAR(law->in_plane.exponent, 0.3, 0.1);
  const auto level = [&](const char* channel) {
    return std::abs(law->curvature.at(0.0, channel, 0.06e-3)[0]);
  };
  EXPECT_GT(level("fy"), 1.0);
  EXPECT_LT(level("fz"), 0.2);
}

// The lines of a linear law do not justify a nonlinear one.
TEST(NonlinearChipLaw, IsNotJustifiedByLinearLines) {
  const auto law = lawOf({});
  ASSERT_TRUE(law);
  EXPECT_LT(law->linear_squares, 1.2 * law->line_count);
}

TEST(RevolutionTable, RequiresCutsThatDifferInFeedOnly) {
  const TemporaryFolder folder;
  EXPECT_FALSE(tableOf(slotsAt(slotsOfManyKinds(), folder.file("."))));
}

}  // namespace
}  // namespace smartmill::discrepancy
