#include "smartmill_loadmeter/database/fleet_model.h"

#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill::loadmeter {
namespace {

std::string nameOf(int machine) {
  return "mill " + std::to_string(100 + machine);
}

/// Shop with known deviations: machines x materials x tools, cuts of each cell.
struct Shop {
  int machines = 50, materials = 4, tools = 2, cuts = 2;
  FleetDeviations s{0.04, 0.01, 0.08, 0.02};
  std::vector<double> group, effect;  // of the logarithm
  std::vector<FleetObservation> observations;

  double normal(std::mt19937& random, double deviation) {
    return std::normal_distribution<double>(0.0, deviation)(random);
  }
  std::size_t groupAt(int material, int tool) const {
    return static_cast<std::size_t>(material * tools + tool);
  }

  /// @param share of the cells with cuts
  void draw(unsigned seed, double share) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform;
    for (int j = 0; j < materials; ++j) {
      const double mean = std::log(700e6 + 1500e6 * uniform(random));
      for (int t = 0; t < tools; ++t) group.push_back(mean + normal(random, s.tool));
    }
    for (int m = 0; m < machines; ++m) {
      effect.push_back(normal(random, s.machine));
      for (int j = 0; j < materials; ++j) {
        for (int t = 0; t < tools; ++t) {
          const double batch = normal(random, s.batch);
          if (uniform(random) > share) continue;
          for (int c = 0; c < cuts; ++c) {
            const double y =
                group[groupAt(j, t)] + effect.back() + batch + normal(random, std::hypot(s.noise, 0.01));
            observations.push_back({nameOf(m), "material " + std::to_string(j), "tool " + std::to_string(t),
                                    std::exp(y), 0.01 * std::exp(y),
                                    1000.0 * static_cast<double>(observations.size())});
          }
        }
      }
    }
  }
};

// Balanced one-way random effects (Searle, Casella, McCulloch 1992, section 3): with a machine's mean ym over
// n cuts and the grand mean y, BLUP = n s_b^2 / (n s_b^2 + s_e^2) (ym - y); var(y) = (s_b^2 + s_e^2 / n) / M.
TEST(FleetModel, isTheClosedFormOfTheBalancedOneWayLayout) {
  const int machines = 8, cuts = 3;
  const double b = 0.05, e = 0.03;
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  std::vector<FleetObservation> observations;
  std::vector<double> mean(machines, 0.0);
  double grand = 0.0;
  for (int m = 0; m < machines; ++m) {
    const double effect = b * normal(random);
    for (int c = 0; c < cuts; ++c) {
      const double y = 20.0 + effect + e * normal(random);
      mean[static_cast<std::size_t>(m)] += y / cuts;
      grand += y / (cuts * machines);
      observations.push_back({nameOf(m), "1018", "endmill", std::exp(y), 0.0, 0.0});
    }
  }
  FleetModelOptions options;
  options.outlier_probability = 0.0;
  options.known = FleetDeviations{b, 0.0, 0.1, e};
  const FleetModel model(observations, options);
  const double shrink = cuts * b * b / (cuts * b * b + e * e), of_grand = (b * b + e * e / cuts) / machines;
  const auto effects = model.machines();
  ASSERT_EQ(effects.size(), 8u);
  for (int m = 0; m < machines; ++m) {
    const auto at = static_cast<std::size_t>(m);
    const double blup = shrink * (mean[at] - grand);
    EXPECT_NEAR(effects[at].effect, blup, 1e-9);
    EXPECT_NEAR(std::pow(effects[at].std_dev, 2), b * b * (1.0 - shrink) + shrink * shrink * of_grand, 1e-12);
    const auto own = model.predict(nameOf(m), "1018", "endmill");
    ASSERT_TRUE(own);
    EXPECT_NEAR(std::log(own->value), grand + blup, 1e-9);
    EXPECT_EQ(own->own, cuts);
  }
  const auto stranger = model.predict("another", "1018", "endmill");
  ASSERT_TRUE(stranger);
  EXPECT_NEAR(std::log(stranger->value), grand, 1e-9);
  EXPECT_NEAR(stranger->log_std * stranger->log_std, b * b + of_grand, 1e-12);
  EXPECT_FALSE(model.predict("another", "titanium", "endmill"));
}

// Restricted likelihood of the balanced layout: s_e^2 = MSW, s_b^2 = (MSB - MSW) / n. With 200 machines the
// posterior mean is within a tenth of its deviation, s_b / sqrt(2 M) = 5 %.
TEST(FleetModel, findsTheDeviationsOfTheBalancedLayout) {
  const int machines = 200, cuts = 4;
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  std::vector<FleetObservation> observations;
  double between = 0.0, within = 0.0, grand = 0.0;
  std::vector<double> means;
  for (int m = 0; m < machines; ++m) {
    const double effect = 0.05 * normal(random);
    std::vector<double> y;
    for (int c = 0; c < cuts; ++c) y.push_back(20.0 + effect + 0.02 * normal(random));
    const double mean = (y[0] + y[1] + y[2] + y[3]) / cuts;
    for (const double one : y) {
      within += std::pow(one - mean, 2) / (machines * (cuts - 1.0));
      observations.push_back({nameOf(m), "1018", "endmill", std::exp(one), 0.0, 0.0});
    }
    means.push_back(mean);
    grand += mean / machines;
  }
  for (const double mean : means) between += cuts * std::pow(mean - grand, 2) / (machines - 1.0);
  FleetModelOptions options;
  options.outlier_probability = 0.0;
  const FleetDeviations found = FleetModel(observations, options).deviations();
  EXPECT_NEAR(found.noise, std::sqrt(within), 1e-9);
  // This layout does not separate a machine's effect from its only batch, but determines their sum of
  // squares.
  EXPECT_NEAR(std::hypot(found.machine, found.batch), std::sqrt((between - within) / cuts), 0.005);
}

TEST(FleetModel, bandsAreCalibratedForMachinesNewToAMaterial) {
  Coverage first, after, of_machines;
  for (unsigned seed = 1; seed <= 14; ++seed) {
    Shop shop;
    shop.draw(seed, 0.5);
    // Machines 0..19 have not cut material 0; then one cut each.
    std::vector<FleetObservation> known, cut;
    for (const FleetObservation& o : shop.observations) {
      const bool is_new = o.material == "material 0" && o.machine < nameOf(20);
      (is_new ? cut : known).push_back(o);
    }
    const FleetModel model(known);
    std::string last;
    for (const FleetObservation& o : cut) {
      if (o.machine == last) continue;
      last = o.machine;
      const auto p = model.predict(o.machine, o.material, o.tool);
      ASSERT_TRUE(p);
      EXPECT_EQ(p->own, 0);
      first.add(std::log(o.value / p->value), std::hypot(p->log_std, shop.s.noise, 0.01));
    }
    for (const MachineEffect& m : model.machines()) {
      const auto at = static_cast<std::size_t>(std::stoi(m.machine.substr(5)) - 100);
      of_machines.add(m.effect - shop.effect[at], m.std_dev);
    }
  }
  EXPECT_TRUE(first.isCalibrated());
  // Machines of a shop share the uncertainty of its groups.
  EXPECT_TRUE(of_machines.isCalibrated(Coverage::RUNS));
}

TEST(FleetModel, firstCutsNarrowTheBand) {
  Shop shop;
  shop.draw(4, 0.6);
  std::vector<FleetObservation> observations = shop.observations;
  const double truth = shop.group[shop.groupAt(1, 0)] + 0.10;
  double last = 1.0;
  for (int cuts = 0; cuts < 4; ++cuts) {
    const auto p = FleetModel(observations).predict("new", "material 1", "tool 0");
    ASSERT_TRUE(p);
    EXPECT_LT(p->log_std, last);
    EXPECT_NEAR(std::log(p->value), truth, 3.0 * p->log_std);
    last = p->log_std;
    observations.push_back({"new", "material 1", "tool 0", std::exp(truth + 0.01 * (cuts % 2 ? 1 : -1)),
                            0.01 * std::exp(truth), 0.0});
  }
}

TEST(FleetModel, namesTheOutlierAndNoOther) {
  Shop shop;
  shop.draw(9, 0.5);
  for (FleetObservation& o : shop.observations)
    if (o.machine == nameOf(17)) o.value *= 1.25;
  for (const MachineEffect& m : FleetModel(shop.observations).machines()) {
    if (m.machine == nameOf(17)) {
      EXPECT_GT(m.outlier, 0.95);
      EXPECT_NEAR(m.effect, std::log(1.25) + shop.effect[17], 3.0 * m.std_dev);
      EXPECT_THAT(m.meaning(), ::testing::HasSubstr("load-meter constant"));
    } else {
      EXPECT_LT(m.outlier, 0.5) << m.machine;
    }
  }
}

TEST(FleetModel, distinguishesAChangeFromAConstant) {
  Shop shop;
  shop.cuts = 6;
  shop.draw(11, 0.5);
  int cut = 0;
  for (FleetObservation& o : shop.observations) {
    o.stamp = 1e4 * (cut++ % shop.cuts);
    if (o.machine == nameOf(3)) o.value *= std::exp(0.3 + 3e-6 * o.stamp);
  }
  for (const MachineEffect& m : FleetModel(shop.observations).machines()) {
    if (m.machine != nameOf(3)) continue;
    EXPECT_GT(m.outlier, 0.95);
    EXPECT_NEAR(m.drift, 3e-6, 4.0 * m.drift_std);
    EXPECT_THAT(m.meaning(), ::testing::HasSubstr("changes with time"));
  }
}

TEST(FleetModel, refusesInvalidObservations) {
  EXPECT_EQ(errorOf([] { FleetModel({}); }), "fleet: no observations");
  EXPECT_EQ(errorOf([] {
              FleetModel({{"mill", "1018", "t", -1.0, 0.1, 0.0}});
            }),
            "fleet: value of 'mill' in '1018': expected a finite number > 0");
}

}  // namespace
}  // namespace smartmill::loadmeter
