#include "smartmill_stability/chart/what_if.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_stability/chart/chart.h"
#include "smartmill_stability/chart/limit_continuation.h"
#include "smartmill_stability_testing/benchmark.h"

namespace smartmill::stability {
namespace {

ChartMaker benchmarkMaker(double direct = 0.0) {
  ChartParameters parameters;
  parameters.speed_low = units::radPerSecFromRpm(5000.0);
  parameters.radial_ratio = 1.0 / 3.0;
  parameters.method = "auto";
  ChartMaker maker(parameters, machine());
  for (const char* direction : {"x", "y"}) {
    MeasuredModes modes;
    modes.tool = "end_mill";
    modes.point = POINT_TOOL_TIP;
    modes.direction = direction;
    modes.unit = "m/N";
    modes.model = benchmark();
    modes.model.direct = direct;
    maker.handle(modes);
  }
  maker.handle(coefficients());
  return maker;
}

// Continuation compared with the solver that searches each of 300 speeds from depth zero, in a slot, at a
// third and at a small immersion with flip lobes. Interpolation is permitted an error of 1 %, exceeded at
// most at five speeds where lobes intersect.
TEST(WhatIf, ContinuationGivesTheLimitsOfTheFullSearch) {
  for (const double exit_deg : {180.0, 60.0, 30.0}) {
    const RegenerativeSystem system = *benchmarkMaker().system({0.0, units::radFromDeg(exit_deg), 0.0, 0.0});
    std::vector<double> speeds;
    for (int i = 0; i < 300; ++i) speeds.push_back(units::radPerSecFromRpm(5000.0 + 50.0 * i));
    constexpr double DEEPEST = 5e-3;
    const StabilityLimit found = limitsByContinuation(system, speeds, DEEPEST);
    const std::vector<Limit> exact = makeFloquetSolver(Method::collocation, system)->limits(speeds, DEEPEST);
    ASSERT_EQ(found.depth.size(), speeds.size());
    int off = 0;
    for (std::size_t k = 0; k < speeds.size(); ++k) {
      if (std::isinf(found.depth[k]) && exact[k].depth > 0.97 * DEEPEST) continue;
      const double ratio = found.depth[k] / exact[k].depth;
      off += !(std::abs(ratio - 1.0) <= 0.01);
      EXPECT_NEAR(ratio, 1.0, 0.05) << exit_deg << " deg, speed " << k;
    }
    EXPECT_LE(off, 5) << exit_deg << " deg";
  }
}

/// Relative errors above a bound of limits for a chart, compared with the search from depth zero at each
/// speed.
struct ChartErrors {
  int above = 0;
  double most = 0.0;
};

ChartErrors errorsOfChart(const RegenerativeSystem& system, double bound) {
  std::vector<double> speeds;
  for (int i = 0; i < 300; ++i) speeds.push_back(units::radPerSecFromRpm(3000.0 + 57.0 * i));
  constexpr double DEEPEST = 5e-3;
  const StabilityLimit found = limitsByContinuation(system, speeds, DEEPEST, ContinuationAccuracy::ofChart());
  const std::vector<Limit> exact = makeFloquetSolver(Method::collocation, system)->limits(speeds, DEEPEST);
  ChartErrors errors;
  for (std::size_t k = 0; k < speeds.size(); ++k) {
    if (std::min(found.depth[k], exact[k].depth) > 0.97 * DEEPEST) continue;
    const double error = std::abs(found.depth[k] / exact[k].depth - 1.0);
    errors.above += !(error <= bound);
    errors.most = std::max(errors.most, error);
  }
  return errors;
}

// Pockets of a published chart are to be right to 1 %; the interpolation is permitted 0.1 %, more only where
// lobes intersect.
TEST(WhatIf, ContinuationOfAChartIsRightToAFewTenthsOfAPercent) {
  for (const double exit_deg : {180.0, 60.0, 30.0}) {
    const ChartErrors errors =
        errorsOfChart(*benchmarkMaker().system({0.0, units::radFromDeg(exit_deg), 0.0, 0.0}), 0.003);
    EXPECT_LE(errors.above, 1) << exit_deg;
    EXPECT_LT(errors.most, 0.015) << exit_deg;
  }
}

// Without a zero-order guess: uneven pitch, helix, process damping. At single speeds where lobes intersect a
// narrow one is missed, and the limit is that of the next.
TEST(WhatIf, ContinuationOfAChartNeedsNoGuess) {
  RegenerativeSystem system = *benchmarkMaker().system({0.0, units::radFromDeg(90.0), 0.0, 0.0});
  system.pitch = {units::radFromDeg(170.0), units::radFromDeg(190.0)};
  system.helix = units::radFromDeg(30.0);
  system.setProcessDamping(20e3);
  const ChartErrors errors = errorsOfChart(system, 0.003);
  EXPECT_LE(errors.above, 3);
  EXPECT_LT(errors.most, 0.06);
}

// The result does not depend on the distribution of the speeds to threads.
TEST(WhatIf, TwoCallsAreIdentical) {
  const RegenerativeSystem system = *benchmarkMaker().system({});
  std::vector<double> speeds;
  for (int i = 0; i < 101; ++i) speeds.push_back(units::radPerSecFromRpm(5000.0 + 150.0 * i));
  EXPECT_EQ(limitsByContinuation(system, speeds, 5e-3).depth,
            limitsByContinuation(system, speeds, 5e-3).depth);
}

TEST(WhatIf, WithoutChangesGivesTheChart) {
  const ChartMaker maker = benchmarkMaker();
  WhatIf same;
  same.speeds = 31;
  same.axial_depth = 0.05e-3;
  const WhatIfChart chart = maker.whatIf(same);
  ASSERT_EQ(chart.limit.depth.size(), 31u);
  const auto solver = makeSolver(Method::collocation, *maker.system({}));
  for (const std::size_t k : {10u, 20u, 30u})
    EXPECT_NEAR(chart.limit.depth[k] / solver->limit(chart.limit.spindle_speed[k], 0.02).depth, 1.0, 0.005);
  EXPECT_GT(chart.stable_share, 0.5);
  EXPECT_TRUE(chart.limit_low.empty());
  // At the torque limit the cutting torque is the rated torque minus friction.
  const Prediction prediction = maker.predict(units::radPerSecFromRpm(10000.0), 0.05e-3);
  const double torque_at_limit = prediction.point.torque * chart.torque_depth_limit[10] / 0.05e-3;
  EXPECT_NEAR(torque_at_limit, 20.0 - 0.1 - 1e-3 * units::radPerSecFromRpm(10000.0), 1e-6);
}

// In a slot the sum of the directional coefficients of four straight teeth is constant, so the zero-order
// solution (Altintas and Budak) is exact.
TEST(WhatIf, FourTeethInASlotHaveTheZeroOrderLimits) {
  const ChartMaker maker = benchmarkMaker();
  WhatIf four;
  four.speeds = 60;
  four.teeth = 4;
  const WhatIfChart chart = maker.whatIf(four);
  RegenerativeSystem system = *maker.system({});
  system.teeth = 4;
  const std::vector<Limit> exact =
      makeSolver(Method::zero_order, system)->limits(chart.limit.spindle_speed, 1.0);
  int off = 0, compared = 0;
  for (std::size_t k = 0; k < exact.size(); ++k) {
    if (std::isinf(chart.limit.depth[k])) continue;
    ++compared;
    off += !(std::abs(chart.limit.depth[k] / exact[k].depth - 1.0) <= 0.01);
  }
  EXPECT_GT(compared, 50);
  EXPECT_LE(off, 1);  // at the intersection of two lobes
}

TEST(WhatIf, OverhangScalesAsACantileverBeam) {
  const std::vector<SystemMode> modes = systemModes(benchmark(), benchmark());
  const std::vector<SystemMode> longer = withOverhang(modes, 2.0);
  EXPECT_NEAR(std::abs(receptance(longer, 0.0)[0]) / std::abs(receptance(modes, 0.0)[0]), 8.0, 1e-9);
  EXPECT_DOUBLE_EQ(longer[0].frequency, 922.0 / 4.0);
  EXPECT_EQ(longer[0].damping_ratio, modes[0].damping_ratio);
}

TEST(WhatIf, NamesTheLimitingMode) {
  std::vector<SystemMode> modes = systemModes(benchmark(), benchmark());
  modes[1].frequency = 2000.0;
  EXPECT_EQ(dominantMode(modes, 930.0), 0);
  EXPECT_EQ(dominantMode(modes, 2050.0), 1);
  EXPECT_EQ(dominantMode(modes, WhatIf::SAME), -1);
  WhatIf request;
  request.speeds = 20;
  const WhatIfChart chart = benchmarkMaker().whatIf(request);
  EXPECT_EQ(chart.modes.at(0), "x 922 Hz");
  EXPECT_EQ(chart.modes.at(1), "y 922 Hz");
  for (std::size_t k = 0; k < 20; ++k) EXPECT_EQ(chart.mode[k] >= 0, std::isfinite(chart.limit.depth[k]));
}

TEST(WhatIf, SpreadLiesAroundTheLimit) {
  WhatIf request;
  request.speeds = 40;
  request.spread = true;
  for (const double direct : {0.0, 1e-9}) {  // a residual compliance is one more mode
    const WhatIfChart chart = benchmarkMaker(direct).whatIf(request);
    ASSERT_EQ(chart.limit_low.size(), 40u);
    for (std::size_t k = 0; k < 40; ++k) {
      EXPECT_LT(chart.limit_low[k], chart.limit_high[k]) << k;
      EXPECT_GT(chart.limit_low[k], 0.0) << k;
    }
  }
}

TEST(WhatIf, RefusesInvalidRequests) {
  const ChartMaker maker = benchmarkMaker();
  const auto refused = [&](auto change) {
    WhatIf request;
    change(request);
    EXPECT_THROW(maker.whatIf(request), Error);
  };
  refused([](WhatIf& w) { w.teeth = 21; });
  refused([](WhatIf& w) { w.teeth = -1; });
  refused([](WhatIf& w) { w.helix = 1.5; });
  refused([](WhatIf& w) { w.exit = 7.0; });
  refused([](WhatIf& w) { w.entry = 3.0, w.exit = 1.0; });
  refused([](WhatIf& w) { w.overhang = 0.0; });
  refused([](WhatIf& w) { w.feed_per_tooth = -1e-4; });
  refused([](WhatIf& w) { w.axial_depth = 0.0; });
  refused([](WhatIf& w) { w.speeds = 1; });
  refused([](WhatIf& w) { w.speeds = 100000; });
  ChartParameters parameters;
  EXPECT_THROW(ChartMaker(parameters, machine()).whatIf({}), Error);
}

}  // namespace
}  // namespace smartmill::stability
