// A feed error of a rigid tool is nearly equivalent to a common factor on all chip coefficients; their stated
// uncertainty decides. With coefficients that scatter from revolution to revolution the residual is far above
// the noise.
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/testing/temporary_folder.h"

#include "explain/small_campaign.h"

namespace smartmill::discrepancy {
namespace {

constexpr double SCATTER = 0.01;  // [1] from revolution to revolution

Record scattered(Record record, const CampaignTest& test, std::uint64_t seed, double scatter) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const double revolution = 2.0 * units::PI / test.spindle_speed;
  std::vector<double> factors;
  for (const char* const channel : {"fx", "fy", "fz"}) {
    std::vector<double>& force = record.add(channel);
    for (std::size_t i = 0; i < force.size(); ++i) {
      const auto n = static_cast<std::size_t>(record.time[i] / revolution);
      while (factors.size() <= n) factors.push_back(1.0 + scatter * normal(random));
      force[i] *= factors[n];
    }
  }
  return record;
}

// Chip coefficients 3 and 0 % off, edge coefficients 4 %, stated to 3 %.
Explanation withFeedOf(double ratio, double scatter) {
  const TemporaryFolder folder;
  MachineModel machine = real();
  if (ratio != 1.0) machine.effects = {effectEntry("feed_error", {{"ratio", ratio}})};
  sim::SimulationOptions options;
  options.substeps = 8;
  return explained(
      [&](const CampaignTest& test, std::uint64_t seed) {
        options.seed = seed;
        return scattered(sim::simulateTest(machine, test, 0.1, options), test, seed, scatter);
      },
      folder.file("."));
}

void expectFeedErrorFound(const Explanation& e, double ratio) {
  ASSERT_EQ(e.effects.size(), 1u);
  EXPECT_EQ(e.effects.front().name, "feed_error");
  const FoundParameter& found = e.effects.front().parameters.front();
  EXPECT_NEAR(found.value, ratio, 3.0 * found.std_dev);
  EXPECT_LT(found.std_dev, 0.05);
}

TEST(PriorTension, RevealsAnEffect) {
  expectFeedErrorFound(withFeedOf(0.87, 0.0), 0.87);
}

TEST(PriorTension, RevealsAnEffectDespiteScatter) {
  const Explanation e = withFeedOf(0.87, SCATTER);
  EXPECT_GT(e.after.fit, 1.2);
  expectFeedErrorFound(e, 0.87);
}

// Deviations within the stated uncertainty are no prior tension.
TEST(PriorTension, IsAbsentWithinTheStatedUncertainty) {
  const Explanation e = withFeedOf(1.0, SCATTER);
  EXPECT_GT(e.after.fit, 1.2);
  EXPECT_TRUE(e.effects.empty());
}

}  // namespace
}  // namespace smartmill::discrepancy
