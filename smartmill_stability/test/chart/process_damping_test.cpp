// Process damping: solvers against a closed form, charts of a model with the effect, estimated coefficient.

#include "smartmill_stability/chart/process_damping.h"

#include <cmath>
#include <fstream>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_stability/chart/chart.h"
#include "smartmill_stability/solvers/model_system.h"
#include "smartmill_stability_testing/damped_slot.h"

namespace smartmill::stability {
namespace {

using units::radPerSecFromRpm;

constexpr double DEEPEST = 20e-3;

DampedSlot slot(double coefficient) {
  DampedSlot slot;
  slot.coefficient = coefficient;
  return slot;
}

// At 600 rpm the limit is 1.75 times that without process damping, at 9000 rpm 1.05 times.
TEST(ProcessDamping, solversGiveTheClosedFormOfASlot) {
  const DampedSlot damped = slot(12e3), bare = slot(0.0);
  SolverOptions fine;
  fine.steps = 1600;
  fine.order = 2;
  for (const double rpm : {600.0, 900.0, 2000.0, 9000.0}) {
    const double speed = radPerSecFromRpm(rpm), expected = damped.limit(speed);
    ASSERT_TRUE(std::isfinite(expected)) << rpm;
    EXPECT_GT(expected, (rpm < 700.0 ? 1.7 : 1.04) * bare.limit(speed)) << rpm;
    const RegenerativeSystem system = damped.system();
    // Zero-order is exact here, as the sums of the teeth are constant; its frequencies are interpolated.
    EXPECT_NEAR(makeSolver(Method::collocation, system)->limit(speed, DEEPEST).depth / expected, 1.0, 1e-5)
        << rpm;
    EXPECT_NEAR(makeSolver(Method::zero_order, system)->limit(speed, DEEPEST).depth / expected, 1.0, 1e-3)
        << rpm;
    EXPECT_NEAR(makeSolver(Method::semi_discretization, system, fine)->limit(speed, DEEPEST).depth / expected,
                1.0, 2e-3)
        << rpm;
  }
}

TEST(ProcessDamping, solversGiveTheClosedFormOfTurning) {
  DampedSlot turning = slot(40e3);
  turning.waves = 1;
  turning.diameter = 0.1;
  for (const double rpm : {400.0, 1000.0, 4000.0}) {
    const double speed = radPerSecFromRpm(rpm), expected = turning.limit(speed);
    ASSERT_TRUE(std::isfinite(expected)) << rpm;
    EXPECT_NEAR(makeSolver(Method::collocation, turning.system())->limit(speed, DEEPEST).depth / expected,
                1.0, 1e-5)
        << rpm;
  }
}

// The least limit of a lobe is that of the damping ratio z + C b / (2 m w_n v): 2 k z (1 + z) / Kr.
TEST(ProcessDamping, theLeastLimitGrowsWithTheDampingRatio) {
  const DampedSlot damped = slot(12e3);
  const auto solver = makeSolver(Method::collocation, damped.system());
  // One lobe: 23.05 waves in a tooth period at 600 rpm.
  double least = 1e9;
  for (double rpm = 590.0; rpm < 615.5; rpm += 0.5) {
    const double speed = radPerSecFromRpm(rpm);
    const double ratio =
        solver->limit(speed, DEEPEST).depth / damped.leastLimit(0.5 * damped.diameter * speed);
    EXPECT_GT(ratio, 0.9999) << rpm;
    least = std::min(least, ratio);
  }
  EXPECT_NEAR(least, 1.0, 2e-3);  // 50 speeds of a lobe
  EXPECT_GT(damped.leastLimit(0.63), 2.0 * slot(0.0).leastLimit(0.63));
}

// C / v above Kr / w_n: the damping grows faster with the depth than the regeneration.
TEST(ProcessDamping, belowAnAbsoluteSpeedEveryDepthIsStable) {
  const DampedSlot damped = slot(12e3);
  const double v = damped.coefficient * damped.natural() / damped.kr;
  const auto solver = makeSolver(Method::collocation, damped.system());
  EXPECT_TRUE(std::isinf(solver->limit(0.95 * v / (0.5 * damped.diameter), DEEPEST).depth));
  EXPECT_TRUE(std::isinf(damped.leastLimit(0.95 * v)));
  const double faster = 1.5 * v / (0.5 * damped.diameter);
  EXPECT_NEAR(solver->limit(faster, DEEPEST).depth / damped.limit(faster), 1.0, 1e-5);
}

MachineModel modelOf(const DampedSlot& slot) {
  MachineModel model = machine();
  model.tool = ToolGeometry{4, slot.diameter, 0.0, {}};
  CuttingCoefficients cutting{};
  cutting.ktc = 3.0 * slot.kr;
  cutting.krc = slot.kr;
  model.cutting = cutting;
  model.tool_tip.x.modes = {{slot.frequency, slot.damping_ratio, 1.0 / slot.stiffness()}};
  if (slot.coefficient != 0.0) {
    ProcessDampingEstimate given;
    given.coefficient = slot.coefficient;
    model = withProcessDamping(model, given);
  }
  return model;
}

TEST(ProcessDamping, aModelFileWithTheEffectHasItsLimits) {
  const TemporaryFolder temporary;
  const std::string file = temporary.file("damped.yaml");
  MachineModel model = modelOf(slot(12e3));
  model.spindle.reset();
  writeMachineModel(model, file);
  const RegenerativeSystem system = systemOf(readMachineModel(file), 0.0, 180.0);
  EXPECT_NEAR(system.damping_radial, 12e3, 1e-6);
  EXPECT_NEAR(system.damping_tangential, 3.6e3, 1e-6);
  const double speed = radPerSecFromRpm(600.0);
  EXPECT_NEAR(makeSolver(Method::collocation, system)->limit(speed, DEEPEST).depth / slot(12e3).limit(speed),
              1.0, 1e-5);
  MachineModel driven = modelOf(slot(-1.0));
  try {
    systemOf(driven, 0.0, 180.0);
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("machine.yaml: effects: process_damping: coefficient_n_per_mm"),
              std::string::npos);
  }
}

/// A chart maker with the measured dynamics of the slot.
ChartMaker makerOf(const DampedSlot& slot, const std::string& method) {
  ChartParameters parameters;
  parameters.speed_low = radPerSecFromRpm(600.0);
  parameters.speed_high = radPerSecFromRpm(1200.0);
  parameters.speeds = 100;
  parameters.frequency_high = 3000.0;
  parameters.method = method;
  ChartMaker maker(parameters, modelOf(slot));
  CoefficientSet cutting = coefficients();
  cutting.value.krc = slot.kr;
  maker.handle(cutting);
  for (const char* direction : {"x", "y"}) {
    // The closed form has no motion along y.
    ModalModel model = benchmark();
    if (direction == std::string("y")) model.modes.front().gain *= 1e-9;
    MeasuredFrf measured = frf(direction, 0.25);
    for (std::size_t i = 0; i < measured.frf.size(); ++i)
      measured.frf.value[i] = model.response(measured.frf.frequency[i]);
    maker.handle(measured);
    maker.handle(MeasuredModes{10.0, "end_mill", POINT_TOOL_TIP, direction, "m/N", model, 0.0});
  }
  return maker;
}

// Chart, prediction and what if of a model with the effect, from modes and from measured FRFs.
TEST(ProcessDamping, chartsOfTheNodeShowTheLowSpeedRegion) {
  const DampedSlot damped = slot(12e3);
  for (const char* method : {"collocation", "zero_order"}) {
    const ChartMaker maker = makerOf(damped, method);
    const StabilityChart chart = maker.chart();
    EXPECT_EQ(chart.method, method);
    int off = 0, compared = 0;
    for (std::size_t k = 0; k < chart.limit.depth.size(); k += 7) {
      const double expected = damped.limit(chart.limit.spindle_speed[k]);
      ++compared;
      off += !(std::abs(chart.limit.depth[k] / expected - 1.0) < 0.01);
    }
    EXPECT_LE(off, 1) << method << ": of " << compared;  // where lobes intersect
    const double speed = radPerSecFromRpm(700.0);
    EXPECT_NEAR(maker.predict(speed, 1e-4).point.depth_limit / damped.limit(speed), 1.0, 0.01) << method;
  }
  WhatIf request;
  request.speeds = 300;
  const WhatIfChart what_if = makerOf(damped, "auto").whatIf(request);
  int off = 0;
  for (std::size_t k = 0; k < 300; k += 11)
    off += !(std::abs(what_if.limit.depth[k] / damped.limit(what_if.limit.spindle_speed[k]) - 1.0) < 0.02);
  EXPECT_LE(off, 1);
}

/// Cuts of a machine with limits off by a common factor, each deepened by 10 % until it chatters, with a
/// scatter of each limit.
std::vector<JudgedCut> deepenedCuts(const DampedSlot& slot, const std::vector<double>& limits,
                                    const std::vector<double>& speeds, const ProcessDampingOptions& options,
                                    std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const double scale = std::exp(options.scale_std * normal(random));
  std::vector<JudgedCut> cuts;
  for (std::size_t k = 0; k < speeds.size(); ++k) {
    for (double depth = 0.7 * slot.leastLimit(1e6);; depth *= 1.1) {
      const double limit = limits[k] * scale * std::exp(options.scatter * normal(random));
      cuts.push_back({speeds[k], depth, depth > limit});
      if (cuts.back().chatter) break;
    }
  }
  return cuts;
}

// Seeded observations from the closed form: the interval of two standard deviations contains the coefficient
// in 95 % of the sets, within four standard deviations of the count of 120; the mean is right within four
// standard errors and 3 %, since the likelihood is not symmetric.
TEST(ProcessDampingEstimate, coversTheCoefficientOfSimulatedCuts) {
  const DampedSlot truth = slot(12e3);
  const ProcessDampingOptions options;
  std::vector<double> speeds, limits;
  for (const double rpm : {4000.0, 2000.0, 1200.0, 800.0, 650.0}) {
    speeds.push_back(radPerSecFromRpm(rpm));
    limits.push_back(truth.limit(speeds.back()));
  }
  std::vector<JudgedCut> widest;
  for (std::size_t k = 0; k < speeds.size(); ++k) widest.push_back({speeds[k], 2.0 * limits[k], true});
  ProcessDampingChart chart(slot(0.0).system(), widest);
  EXPECT_NEAR(chart.limit(speeds.back(), truth.coefficient) / limits.back(), 1.0, 0.005);
  std::mt19937_64 random(11);
  constexpr int SETS = 120;
  int inside = 0, within_one = 0;
  double sum = 0.0, widths = 0.0;
  for (int i = 0; i < SETS; ++i) {
    const ProcessDampingEstimate found =
        chart.estimate(deepenedCuts(truth, limits, speeds, options, random), options);
    const double off = std::abs(found.coefficient - truth.coefficient);
    inside += off <= 2.0 * found.std_dev;
    within_one += off <= found.std_dev;
    sum += found.coefficient / truth.coefficient;
    widths += found.std_dev / truth.coefficient;
  }
  const double mean = sum / SETS, width = widths / SETS;
  std::printf("inside 1, 2 std: %d, %d of %d; mean %.4f, mean std %.4f\n", within_one, inside, SETS, mean,
              width);
  EXPECT_GE(inside, SETS * 0.954 - 4.0 * std::sqrt(SETS * 0.954 * 0.046));
  EXPECT_NEAR(within_one, SETS * 0.683, 4.0 * std::sqrt(SETS * 0.683 * 0.317));
  EXPECT_NEAR(mean, 1.0, 0.03 + 4.0 * width / std::sqrt(SETS));
  EXPECT_LT(width, 0.2);
}

TEST(ProcessDampingEstimate, withoutProcessDampingTheIntervalContainsZero) {
  const DampedSlot truth = slot(0.0);
  const ProcessDampingOptions options;
  const std::vector<double> speeds{radPerSecFromRpm(2000.0), radPerSecFromRpm(700.0)};
  const std::vector<double> limits{truth.limit(speeds[0]), truth.limit(speeds[1])};
  std::mt19937_64 random(2);
  const std::vector<JudgedCut> cuts = deepenedCuts(truth, limits, speeds, options, random);
  const ProcessDampingEstimate found = ProcessDampingChart(truth.system(), cuts).estimate(cuts, options);
  EXPECT_LT(found.coefficient - 2.0 * found.std_dev, 0.0);
  EXPECT_LT(found.coefficient + 2.0 * found.std_dev, 6e3);
}

TEST(ProcessDampingEstimate, refusesCutsThatDoNotBoundIt) {
  const std::vector<JudgedCut> stable{{radPerSecFromRpm(700.0), 0.1e-3, false},
                                      {radPerSecFromRpm(900.0), 0.2e-3, false}};
  ProcessDampingChart chart(slot(0.0).system(), stable);
  EXPECT_THROW(chart.estimate(stable, {}), Error);
  EXPECT_THROW(ProcessDampingChart(slot(0.0).system(), {}), Error);
  EXPECT_THROW(ProcessDampingChart(slot(0.0).system(), {{0.0, 1e-3, true}}), Error);
}

TEST(ProcessDampingEstimate, readsCutsAndNamesTheWrongLine) {
  const TemporaryFolder temporary;
  const std::string file = temporary.file("cuts.csv");
  const auto read = [&](const std::string& text) {
    std::ofstream(file) << text;
    return readJudgedCuts(file);
  };
  const std::vector<JudgedCut> cuts = read("verdict,rpm,depth_mm\nstable,600,0.5\nchatter,600,0.6\n");
  ASSERT_EQ(cuts.size(), 2u);
  EXPECT_NEAR(cuts[1].speed, radPerSecFromRpm(600.0), 1e-9);
  EXPECT_NEAR(cuts[1].depth, 0.6e-3, 1e-12);
  EXPECT_FALSE(cuts[0].chatter);
  EXPECT_TRUE(cuts[1].chatter);
  const auto message = [&](const std::string& text) -> std::string {
    try {
      read(text);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(message("rpm,depth_mm,verdict\n600,0.5,loud\n").find("line 2: verdict 'loud'"),
            std::string::npos);
  EXPECT_NE(message("rpm,depth_mm\n600,0.5\n").find("column verdict is missing"), std::string::npos);
  EXPECT_NE(message("rpm,depth_mm,verdict\n-600,0.5,stable\n").find("rpm: expected"), std::string::npos);
  EXPECT_NE(message("rpm,depth_mm,verdict\n").find("no cuts"), std::string::npos);
}

}  // namespace
}  // namespace smartmill::stability
