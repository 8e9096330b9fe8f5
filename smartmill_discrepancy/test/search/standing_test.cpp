#include "smartmill_discrepancy/search/standing.h"

#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "explain/small_campaign.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

using Random = std::mt19937_64;

/// A difference of lines at orders 1..8 of a spindle, and what is left: noise of unit variance, lines of
/// random phase at the same orders.
struct Drawn {
  std::vector<double> between, left;

  Drawn(double between_size, double left_size, std::size_t samples, Random& random) {
    std::uniform_real_distribution<double> phase(0.0, units::TWO_PI);
    std::normal_distribution<double> noise;
    between.resize(samples);
    for (std::size_t i = 0; i < samples; ++i) left.push_back(noise(random));
    const double turn = 0.0137 + 1e-3 * phase(random);  // [rad] a sample
    for (int order = 1; order <= 8; ++order) {
      const double a = phase(random), b = phase(random);
      for (std::size_t i = 0; i < samples; ++i) {
        const double at = order * turn * static_cast<double>(i);
        between[i] += between_size / order * std::sin(at + a);
        left[i] += left_size / order * std::sin(at + b);
      }
    }
  }
  AskedTest asked() const {
    AskedTest test;
    test.add(between.data(), left.data(), left.size());
    return test;
  }
};

// |r + d|^2 - |r|^2 = |d|^2 (2 a - 1), by hand.
TEST(AskedShare, ATestAsksForMoreThanHalfWhereItsGapShrinks) {
  Random random(1);
  for (const double left_size : {0.0, 1.0, 5.0}) {
    const Drawn drawn(2.0, left_size, 4000, random);
    double without = 0.0, with = 0.0, squares = 0.0;
    for (std::size_t i = 0; i < drawn.left.size(); ++i) {
      without += std::pow(drawn.left[i] + drawn.between[i], 2);
      with += std::pow(drawn.left[i], 2);
      squares += std::pow(drawn.between[i], 2);
    }
    const AskedShare asked = sharedBy({drawn.asked()});
    EXPECT_NEAR(squares * (2.0 * asked.share - 1.0), without - with, 1e-9 * without);
  }
}

// Of right models the tests ask for 1: deviations are honest from both sides, in noise alone and where lines
// of another cause lie at the very orders of the difference.
TEST(AskedShare, DeviationsAreHonest) {
  for (const double left_size : {0.0, 0.3, 3.0}) {
    Random random(2);
    Coverage coverage;
    for (int k = 0; k < Coverage::RUNS; ++k) {
      const AskedShare asked = sharedBy({Drawn(0.5, left_size, 3000, random).asked()});
      coverage.add(asked.share - 1.0, asked.std_dev);
    }
    EXPECT_TRUE(coverage.honest()) << left_size;
  }
}

// A shape that has nothing to do with what is missing takes as much of it as the fit tests let it; tests that
// it was not fitted to ask for none of it.
TEST(AskedShare, AShapeOfSomethingElseIsDenied) {
  Random random(3);
  int denied = 0;
  for (int k = 0; k < 100; ++k) {
    std::vector<AskedTest> tests;
    for (int t = 0; t < 3; ++t) {
      Drawn drawn(0.5, 2.0, 3000, random);
      for (std::size_t i = 0; i < drawn.left.size(); ++i) drawn.left[i] -= drawn.between[i];
      tests.push_back(drawn.asked());
    }
    const AskedShare asked = sharedBy(tests);
    denied += asked.beyond() < 2.0;
  }
  EXPECT_GE(denied, 95);
}

// What is denied during a search is as far from what is named as that is from a half.
TEST(Standing, WhatTestsCannotTellIsNotDenied) {
  EXPECT_TRUE(Standing::isDenied({-0.4, 0.55}));
  EXPECT_FALSE(Standing::isDenied({0.2, 0.58}));
  EXPECT_FALSE(Standing::isDenied(sharedBy({})));
  for (double share = -1.0; share < 2.0; share += 0.1)
    EXPECT_FALSE(Standing::isDenied({share, 0.2}) && Standing({{share, 0.2}, {1.0, 0.01}}).holds());
}

TEST(AskedShare, NothingToldIsNothingKnown) {
  const AskedShare asked = sharedBy({});
  EXPECT_EQ(asked.beyond(), 0.0);
  EXPECT_NEAR((AskedShare{1.8, 0.1}.beyond()), -3.0, 1e-12);  // of another size
  EXPECT_TRUE((Standing{asked, {1.0, 0.01}}.holds()));        // by the fit tests alone
  EXPECT_FALSE((Standing{asked, {1.0, 0.2}}.holds()));
  EXPECT_TRUE((Standing{{0.9, 0.3}, {1.0, 0.01}}.holds()));
  EXPECT_FALSE((Standing{{0.9, 0.45}, {1.0, 0.01}}.holds()));
  EXPECT_NEAR((Standing{{0.9, 0.2}, {1.0, 0.01}}.confidence()), 0.97725, 1e-5);
}

Record withoutAngle(const CampaignTest& test, std::uint64_t seed) {
  sim::SimulationOptions options;
  options.seed = seed;
  const Record with_angle = sim::simulateTest(believed(), test, 0.2, options);
  Record record;
  record.time = with_angle.time;
  for (const char* name : {"fx", "fy", "fz"}) record.add(name) = with_angle.column(name);
  return record;
}

// What is believed is the machine; nobody measured the spindle's angle.
struct WithoutAngle {
  const TemporaryFolder folder;
  const Dataset data = datasetOf(withoutAngle, folder.file("."));
  Workbench bench{data, WorkbenchOptions{1, 1, 8, {}}};

  FitState stated() const {
    FitState state;
    state.nominal.assign(bench.freedom().coordinates().size(), 0.0);
    return state;
  }
};

// The state with all records laid further on.
FitState turned(const Workbench& bench, const FitState& state, double by) {
  FitState further = state;
  further.turns.resize(bench.quick().turns().size(), 0.0);
  for (std::size_t k = 0; k < further.turns.size(); ++k) {
    if (bench.quick().turns()[k].freedom.value == &Turn::middle) further.turns[k] += by;
  }
  return further;
}

// What lines alone say of an angle and what a fit says differ by little: where that were turned back each
// time, a fit would never settle.
TEST(Workbench, whatFitsFindThemselvesIsNotTurnedBack) {
  WithoutAngle records;
  Workbench& bench = records.bench;
  FitState right = records.stated();
  const FitState near = turned(bench, right, 0.02);
  FitState same = near;
  EXPECT_EQ(bench.turnPhases(same), 0.0);
  EXPECT_EQ(same, near);
  FitState far = turned(bench, right, 0.2);
  EXPECT_GT(bench.turnPhases(far), 0.15);
  // One tooth is as good as another of this tool.
  const double tooth = units::TWO_PI / believed().tool->teeth;
  for (std::size_t k = 0; k < far.turns.size(); ++k) {
    if (bench.quick().turns()[k].freedom.value != &Turn::middle) continue;
    EXPECT_NEAR(std::remainder(far.turns[k], tooth), 0.0, 0.02);
  }
}

// Records whose angle nobody measured lie where a model laid them. One that laid them a tenth of a radian off
// is told of by the forces that it says there, not by those that it would say where another laid them.
TEST(Standing, EachModelIsToldOfRecordsWhereItLaidThem) {
  WithoutAngle records;
  Workbench& bench = records.bench;
  FitState right = records.stated();
  bench.turnPhases(right);
  bench.turnTo(right);
  const FitState off = turned(bench, right, 0.1);
  const AskedShare asked = standingOf(bench, right, off).fitted;
  EXPECT_NEAR(asked.share, 1.0, 0.1);
  EXPECT_LT(asked.std_dev, 0.05);
  // And the same model where it lies is no other one.
  EXPECT_TRUE(std::isinf(standingOf(bench, right, right).fitted.std_dev));
}

}  // namespace
}  // namespace smartmill::discrepancy
