// Properties of bulk charts for any random machine.
#include "stability/bulk_charts.h"

#include <cmath>

#include <gtest/gtest.h>

#include "study_case.h"

namespace smartmill::stability {
namespace {

constexpr ChartDoubt NO_DOUBT{1e-9, 1e-9, 1e-9, 1e-9, 1e-9};

ChartParameters parameters() {
  ChartParameters p;
  p.speed_low = 400.0;
  p.speed_high = 2400.0;
  p.speeds = 60;
  p.entry = units::PI / 2;
  p.exit = units::PI;
  p.method = "zero_order";
  p.use_modes = true;
  p.frequency_std = p.gain_std = 0.0;
  return p;
}

// Cantilever: the tip compliance is proportional to the cube of the overhang, and the critical limit to its
// inverse (Altintas and Budak, eq. 2: proportional to 1 / (Kt G)). The compliance of the spindle keeps it
// below the cube; the damping of both directions is equal.
TEST(BulkCharts, aLongerToolBearsLess) {
  std::mt19937_64 random(5);
  ChartMachine machine = drawChartMachine(random);
  std::vector<double> least, first;
  for (const double diameters : {4.0, 6.0, 8.0}) {
    machine.setOverhang(diameters * machine.x.shank_diameter);
    std::mt19937_64 errors(1);
    const BulkChart found = bulkChart(machine, parameters(), NO_DOUBT, errors);
    least.push_back(found.chart.absolute_depth_limit);
    first.push_back(found.first_mode);
  }
  for (std::size_t k = 1; k < least.size(); ++k) {
    EXPECT_LT(least[k], 0.7 * least[k - 1]);
    EXPECT_LE(first[k], first[k - 1]);
  }
  EXPECT_GT(least[2],
            least[0] / 8.0 / 2.0);  // the cube from 4 to 8 diameters, and a factor 2 for the flutes
}

// A machine with exact measurements gets a stable point; one with errors chatters with the stated
// probability.
TEST(BulkCharts, whatIsKnownExactlyDoesNotChatter) {
  for (unsigned seed = 1; seed <= 6; ++seed) {
    std::mt19937_64 random(seed);
    const ChartMachine machine = drawChartMachine(random);
    const BulkChart found = bulkChart(machine, parameters(), NO_DOUBT, random);
    ASSERT_FALSE(found.chart.recommended.empty()) << seed;
    EXPECT_FALSE(found.chatters) << seed;
  }
}

// Case 116 of the study: 1.93 mm by zero-order theory, 0.84 mm by collocation, at the highest speed, where
// the best point of the zero-order chart chattered on the true machine and on every drawn one.
TEST(BulkCharts, aLossThatZeroOrderTheoryDoesNotSeeIsRecommendedToNobody) {
  std::mt19937_64 random(seedOfCase(1, 116));
  const ChartMachine machine = drawChartMachine(random);
  ChartParameters p = parameters();
  p.speed_low = units::radPerSecFromRpm(3000.0);
  p.speed_high = units::radPerSecFromRpm(24000.0);
  p.speeds = 150;
  p.frequency_std = ChartParameters{}.frequency_std;
  p.gain_std = ChartParameters{}.gain_std;
  const BulkChart found = bulkChart(machine, p, {}, random);
  EXPECT_EQ(found.chart.method, "zero_order");
  ASSERT_FALSE(found.chart.recommended.empty());
  EXPECT_FALSE(found.chatters);
  EXPECT_LE(found.probability, p.risk + 3.0 * std::sqrt(p.risk * (1.0 - p.risk) / 100.0));  // of 100 draws
}

}  // namespace
}  // namespace smartmill::stability
