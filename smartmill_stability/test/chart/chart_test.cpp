#include "smartmill_stability/chart/chart.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>

#include <gtest/gtest.h>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_stability/chart/surface_error.h"
#include "smartmill_stability_testing/benchmark.h"

namespace smartmill::stability {
namespace {

ChartMaker filled(ChartParameters parameters, double step = 1.0) {
  parameters.radial_ratio = 1.0 / 3.0;
  ChartMaker maker(parameters, machine());
  maker.handle(frf("x", step));
  maker.handle(frf("y", step));
  maker.handle(coefficients());
  return maker;
}

ChartParameters slot() {
  ChartParameters parameters;
  parameters.speed_low = units::radPerSecFromRpm(5000.0);
  parameters.method = "auto";  // collocation in tests with modes
  return parameters;
}

// Zero-order limits of the benchmark from an independent table (6000, 10000, 15000, 20000 rpm), printed to
// 0.1 .. 0.2 % and up to 0.5 % above the exact root. Linear interpolation between lines of 1 Hz adds less
// than 0.5 %.
TEST(ChartMaker, measuredFrfsGiveTheLimitsOfTheBenchmark) {
  const ChartMaker maker = filled(slot());
  const double table[][2] = {{6000, 0.0496}, {10000, 0.0737}, {15000, 0.1177}, {20000, 0.0626}};
  for (const auto& row : table) {
    const Prediction prediction = maker.predict(units::radPerSecFromRpm(row[0]), 0.05e-3);
    EXPECT_NEAR(prediction.point.depth_limit * 1e3 / row[1], 1.0, 0.01) << row[0] << " rpm";
    EXPECT_EQ(prediction.stable, row[1] > 0.05) << row[0] << " rpm";
  }
}

// Expects that lines from 2950 to 3050 Hz with a value and a standard deviation, both relative to the peak of
// the FRF, do not affect the chart.
void expectLinesIgnored(std::complex<double> value, double std_dev, double line_error) {
  const StabilityChart clean = filled(slot()).chart();
  ChartParameters parameters = slot();
  parameters.radial_ratio = 1.0 / 3.0;
  parameters.line_error = line_error;
  ChartMaker maker(parameters, machine());
  for (const char* direction : {"x", "y"}) {
    MeasuredFrf noisy = frf(direction, 1.0);
    double peak = 0.0;
    for (const std::complex<double>& v : noisy.frf.value) peak = std::max(peak, std::abs(v));
    noisy.frf.std_dev.assign(noisy.frf.size(), 1e-3 * peak);
    for (std::size_t i = 0; i < noisy.frf.size(); ++i) {
      const double f = noisy.frf.frequency[i];
      if (f < 2950.0 || f > 3050.0) continue;
      noisy.frf.value[i] = peak * (i % 2 ? value : std::conj(value));
      noisy.frf.std_dev[i] = std_dev * peak;
    }
    maker.handle(noisy);
  }
  maker.handle(coefficients());
  const StabilityChart chart = maker.chart();
  ASSERT_EQ(chart.limit.depth.size(), clean.limit.depth.size());
  for (std::size_t k = 0; k < clean.limit.depth.size(); ++k) {
    if (std::isinf(clean.limit.depth[k])) continue;
    ASSERT_NEAR(chart.limit.depth[k] / clean.limit.depth[k], 1.0, 1e-2) << k;
  }
}

// At a zero of the hammer's spectrum the FRF is noise as large as a resonance, with a large standard
// deviation.
TEST(ChartMaker, linesWithoutExcitationAreIgnored) {
  expectLinesIgnored({-1.2, 0.5}, 1.3, 0.05);
}

// Far above the modes the FRF is noise, small compared with the peak, but large enough to close a deep
// pocket.
TEST(ChartMaker, linesBelowTheirStandardDeviationAreIgnored) {
  expectLinesIgnored({-0.1, 0.5}, 0.2, 0.3);
}

// With full engagement no direction is preferred: a structure rotated by 30 degrees about the spindle has the
// same limits with the cross receptances, but not without them.
TEST(ChartMaker, crossFrfsPreserveTheLimitsOfARotatedStructure) {
  ChartParameters parameters = slot();
  parameters.method = "zero_order";
  parameters.radial_ratio = 1.0 / 3.0;
  parameters.exit = units::TWO_PI;
  MeasuredFrf along = frf("x", 1.0), across = frf("y", 1.0);
  // One direction is half as stiff as the other.
  for (std::complex<double>& value : across.frf.value) value *= 2.0;
  const double c = std::cos(units::PI / 6.0), s = std::sin(units::PI / 6.0);
  MeasuredFrf x = along, y = across, xy = along;
  xy.direction = "xy";
  for (std::size_t i = 0; i < along.frf.size(); ++i) {
    const std::complex<double> a = along.frf.value[i], b = across.frf.at(along.frf.frequency[i]);
    x.frf.value[i] = c * c * a + s * s * b;
    y.frf.value[i] = s * s * a + c * c * b;
    xy.frf.value[i] = c * s * (a - b);
  }
  const auto limits = [&](const std::vector<MeasuredFrf>& frfs) {
    ChartMaker maker(parameters, machine());
    for (const MeasuredFrf& one : frfs) maker.handle(one);
    maker.handle(coefficients());
    return maker.chart().limit.depth;
  };
  const std::vector<double> expected = limits({along, across}), rotated = limits({x, y, xy}),
                            without = limits({x, y});
  double most = 0.0, most_without = 0.0;
  for (std::size_t k = 0; k < expected.size(); ++k) {
    if (std::isinf(expected[k])) continue;
    most = std::max(most, std::abs(rotated[k] / expected[k] - 1.0));
    most_without = std::max(most_without, std::abs(without[k] / expected[k] - 1.0));
  }
  EXPECT_LT(most, 1e-6);
  EXPECT_GT(most_without, 0.02);
}

TEST(ChartMaker, modesGiveTheSameChartAsTheirFrf) {
  ChartParameters parameters = slot();
  parameters.radial_ratio = 1.0 / 3.0;
  parameters.method = "zero_order";
  parameters.use_modes = true;
  parameters.frequency_high = 4000.0;
  ChartMaker maker(parameters, machine());
  for (const char* direction : {"x", "y"}) {
    maker.handle(MeasuredModes{10.0, "end_mill", POINT_TOOL_TIP, direction, "m/N", benchmark(), 0.0});
  }
  maker.handle(coefficients());
  const StabilityChart of_modes = maker.chart(), of_frf = filled(slot(), 0.25).chart();
  for (std::size_t k = 0; k < of_modes.limit.depth.size(); ++k) {
    ASSERT_NEAR(of_modes.limit.depth[k] / of_frf.limit.depth[k], 1.0, 2e-3) << k;
  }
  EXPECT_EQ(of_modes.tool, "end_mill");
  EXPECT_EQ(of_modes.material, "aluminium");
  EXPECT_EQ(of_modes.stamp, 20.0);
}

ChartMaker fromModes(ChartParameters parameters, double relative_error) {
  parameters.radial_ratio = 1.0 / 3.0;
  ChartMaker maker(parameters, machine());
  for (const char* direction : {"x", "y"}) {
    maker.handle(frf(direction, 1.0));
    maker.handle(
        MeasuredModes{10.0, "end_mill", POINT_TOOL_TIP, direction, "m/N", benchmark(), relative_error});
  }
  maker.handle(coefficients());
  return maker;
}

// A workpiece as flexible as the tool doubles the receptance and halves every limit, with machines drawn for
// the recommended points.
TEST(ChartMaker, aFlexibleWorkpieceAddsItsReceptance) {
  for (const bool modes : {false, true}) {
    ChartParameters parameters = slot();
    parameters.radial_ratio = 1.0 / 3.0;
    parameters.speeds = 40;
    parameters.use_modes = modes;
    MachineModel flexible = machine();
    flexible.workpiece_modes = {{0.0, benchmark(), benchmark()}};
    std::vector<StabilityChart> charts;
    for (const MachineModel& model : {machine(), flexible}) {
      ChartMaker maker(parameters, model);
      for (const char* direction : {"x", "y"}) {
        maker.handle(frf(direction, 1.0));
        if (modes)
          maker.handle(MeasuredModes{10.0, "end_mill", POINT_TOOL_TIP, direction, "m/N", benchmark(), 0.0});
      }
      maker.handle(coefficients());
      charts.push_back(maker.chart());
    }
    int limited = 0;
    for (std::size_t k = 0; k < charts[0].limit.depth.size(); ++k) {
      if (!(charts[0].limit.depth[k] < parameters.max_depth)) continue;
      ++limited;
      // Continued limits of a chart by collocation: 0.15 %.
      ASSERT_NEAR(charts[1].limit.depth[k] / charts[0].limit.depth[k], 0.5, 1e-3) << modes << k;
    }
    EXPECT_GT(limited, 30);
    EXPECT_FALSE(charts[1].recommended.empty());
  }
  MachineModel several = machine();
  several.workpiece_modes = {{0.0, benchmark(), benchmark()}, {0.1, benchmark(), benchmark()}};
  EXPECT_THROW(ChartMaker(slot(), several), Error);
}

// With known modes the chart is computed by collocation; expected values from an independent table of
// converged limits.
TEST(ChartMaker, knownModesGiveTheConvergedLimits) {
  ChartParameters parameters = slot();
  parameters.speeds = 601;
  const ChartMaker maker = fromModes(parameters, 0.01);
  const double table[][2] = {{6000, 0.0483482}, {10000, 0.0714108}, {15000, 0.1144476}, {20000, 0.0632216}};
  const StabilityChart chart = maker.chart();
  EXPECT_EQ(chart.method, "collocation");
  for (const auto& row : table) {
    const double speed = units::radPerSecFromRpm(row[0]);
    EXPECT_NEAR(maker.predict(speed, 0.05e-3).point.depth_limit * 1e3 / row[1], 1.0, 3e-4)
        << row[0] << " rpm";
    // The chart interpolates between solved speeds.
    const auto& speeds = chart.limit.spindle_speed;
    auto k = static_cast<std::size_t>(std::lower_bound(speeds.begin(), speeds.end(), speed - 1e-9) -
                                      speeds.begin());
    ASSERT_NEAR(speeds[k], speed, 1e-6);
    EXPECT_NEAR(chart.limit.depth[k] * 1e3 / row[1], 1.0, 5e-3) << row[0] << " rpm";
  }
  EXPECT_FALSE(chart.recommended.empty());
  EXPECT_FALSE(chart.unstable.empty());
}

TEST(ChartMaker, autoUsesTheFrfWhenTheModesFitBadly) {
  EXPECT_EQ(fromModes(slot(), 0.3).chart().method, "zero_order");
  EXPECT_EQ(fromModes(slot(), 0.3).solver(),
            "zero_order (modes in x: relative error of the fit 0.3, above modes_error 0.1)");
  EXPECT_EQ(filled(slot()).solver(), "zero_order (no modes in x)");
  EXPECT_EQ(fromModes(slot(), 0.01).solver(), "collocation");
  EXPECT_EQ(ChartParameters().method, "auto");
  ChartParameters parameters = slot();
  parameters.method = "zero_order";
  EXPECT_EQ(fromModes(parameters, 0.01).chart().method, "zero_order");
  parameters.method = "auto";
  parameters.use_modes = true;
  EXPECT_EQ(fromModes(parameters, 0.3).chart().method, "zero_order");
  EXPECT_EQ(filled(parameters).missing(), "modes in x, modes in y");
  parameters.method = "guess";
  EXPECT_THROW(fromModes(parameters, 0.01), Error);
}

TEST(ChartMaker, spindleLimitsFollowTheMeanTorque) {
  const StabilityChart chart = filled(slot()).chart();
  // Energy of a revolution in a slot: Ktc times the removed volume depth x diameter x feed, plus the edge
  // force along half a revolution of each tooth.
  const double energy_per_depth = 6e8 * 0.02 * 2 * 0.1e-3 + 1e4 * 2 * units::PI * 0.01;  // [J/m]
  const double torque_per_depth = energy_per_depth / units::TWO_PI;
  for (std::size_t k = 0; k < chart.limit.spindle_speed.size(); k += 100) {
    const double speed = chart.limit.spindle_speed[k], friction = 0.1 + 1e-3 * speed;
    EXPECT_NEAR(chart.torque_depth_limit[k] * torque_per_depth / (20.0 - friction), 1.0, 1e-12);
    EXPECT_NEAR(chart.power_depth_limit[k] * torque_per_depth / (8000.0 / speed - friction), 1.0, 1e-12);
  }
  ASSERT_FALSE(chart.recommended.empty());
  const StabilityPoint& best = chart.recommended.front();
  EXPECT_NEAR(best.torque / (torque_per_depth * best.axial_depth), 1.0, 1e-12);
  EXPECT_NEAR(best.power / (best.torque * best.spindle_speed), 1.0, 1e-12);
  EXPECT_NEAR(best.material_removal_rate /
                  (best.axial_depth * 0.02 * 2 * 0.1e-3 * best.spindle_speed / units::TWO_PI),
              1.0, 1e-12);
}

// The pockets of one mode lie where the tooth passing frequency is close to the natural frequency (922 Hz x
// 60 / 2 = 27660 rpm, outside this chart) or to an integer fraction of it: 13830 rpm, 9220 rpm.
TEST(ChartMaker, recommendsStablePocketsAndProposesClearlyUnstableValleys) {
  ChartParameters parameters = slot();
  parameters.speed_high = units::radPerSecFromRpm(16000.0);
  const ChartMaker maker = filled(parameters);
  const StabilityChart chart = maker.chart();
  ASSERT_GE(chart.recommended.size(), 2u);
  EXPECT_NEAR(units::rpmFromRadPerSec(chart.recommended[0].spindle_speed), 13830.0, 0.04 * 13830.0);
  EXPECT_NEAR(units::rpmFromRadPerSec(chart.recommended[1].spindle_speed), 9220.0, 0.04 * 9220.0);
  for (std::size_t i = 0; i < chart.recommended.size(); ++i) {
    const StabilityPoint& point = chart.recommended[i];
    for (const double off : {0.991, 1.0, 1.009}) {
      const Prediction prediction = maker.predict(point.spindle_speed * off, point.axial_depth);
      EXPECT_TRUE(prediction.stable);
      EXPECT_LE(point.axial_depth, 0.8 * prediction.point.depth_limit * (1 + 1e-3));
    }
    EXPECT_TRUE(maker.predict(point.spindle_speed, point.axial_depth).within_spindle_limits);
    if (i > 0) {
      EXPECT_GE(chart.recommended[i - 1].material_removal_rate, point.material_removal_rate);
    }
  }
  ASSERT_FALSE(chart.unstable.empty());
  for (const StabilityPoint& point : chart.unstable) {
    for (const double off : {0.991, 1.0, 1.009}) {
      const Prediction prediction = maker.predict(point.spindle_speed * off, point.axial_depth);
      EXPECT_FALSE(prediction.stable);
      EXPECT_GE(point.axial_depth, 1.5 * prediction.point.depth_limit * (1 - 1e-3));
    }
    EXPECT_TRUE(maker.predict(point.spindle_speed, point.axial_depth).within_spindle_limits);
    EXPECT_GT(point.chatter_frequency, 922.0);  // Hopf lobes of a slot lie above the natural frequency
  }
}

// At small immersion, stability is lost by period doubling next to the first lobe, which the zero-order
// solution does not contain (Davies et al. 2002). The recommended points are checked by another solver,
// semi-discretization.
TEST(ChartMaker, recommendsNothingThatIsStableOnlyByTheZeroOrderSolution) {
  ChartParameters parameters = slot();
  parameters.method = "zero_order";
  parameters.use_modes = true;
  parameters.entry = units::radFromDeg(154.0);
  parameters.exit = units::PI;
  parameters.speed_low = units::radPerSecFromRpm(8000.0);
  parameters.speed_high = units::radPerSecFromRpm(20000.0);
  parameters.speeds = 121;
  parameters.frequency_std = 0.003;
  parameters.gain_std = 0.02;
  const auto chattering = [&](double risk) {
    parameters.risk = risk;
    ChartMaker maker = fromModes(parameters, 0.01);
    CoefficientSet identified = coefficients();
    identified.value.krc = 2e8;
    identified.std_dev.ktc = 0.02 * identified.value.ktc;
    identified.std_dev.krc = 0.02 * identified.value.krc;
    maker.handle(identified);
    ModalModel modes = benchmark();
    modes.modes[0].frequency_std = 0.003 * modes.modes[0].frequency;
    modes.modes[0].damping_ratio_std = 0.02 * modes.modes[0].damping_ratio;
    modes.modes[0].gain_std = 0.02 * modes.modes[0].gain;
    for (const char* direction : {"x", "y"})
      maker.handle(MeasuredModes{10.0, "end_mill", POINT_TOOL_TIP, direction, "m/N", modes, 0.01});
    const StabilityChart chart = maker.chart();
    EXPECT_EQ(chart.method, "zero_order");
    EXPECT_FALSE(chart.recommended.empty());
    const auto solver = makeFloquetSolver(Method::semi_discretization, *maker.system({}));
    int count = 0;
    for (const StabilityPoint& cut : chart.recommended) {
      // At the limit of the depth margin.
      const double depth = cut.axial_depth / (1.0 - parameters.depth_margin);
      count += solver->multiplier(cut.spindle_speed, depth).radius() > 1.0;
      if (risk == 0.0) continue;
      // Independent draws with the other solver: 5 of 100, plus three standard deviations.
      const double probability = chatterProbability(*maker.uncertainSystem({}), cut.spindle_speed,
                                                    cut.axial_depth, 100, 7, Method::semi_discretization);
      EXPECT_LE(probability, 0.05 + 3.0 * std::sqrt(0.05 * 0.95 / 100.0));
    }
    return count;
  };
  EXPECT_GT(chattering(0.0), 0)
      << "expected a case in which the zero-order solution recommends an unstable point";
  EXPECT_EQ(chattering(0.05), 0);
}

TEST(ChartMaker, aWeakSpindleLimitsTheRecommendedDepth) {
  MachineModel weak = machine();
  weak.spindle->rated_torque = 0.8;
  ChartParameters parameters = slot();
  parameters.radial_ratio = 1.0 / 3.0;
  parameters.speed_high = 1500.0;
  ChartMaker maker(parameters, weak);
  maker.handle(frf("x", 1.0));
  maker.handle(frf("y", 1.0));
  maker.handle(coefficients());
  const StabilityChart chart = maker.chart();
  for (const auto* points : {&chart.recommended, &chart.unstable}) {
    for (const StabilityPoint& point : *points) EXPECT_LE(point.torque, 0.8);
  }
}

/// Finishing down-milling, 1 mm wide, of the benchmark with edge coefficients.
ChartMaker finishing(double tolerance) {
  ChartParameters parameters = slot();
  parameters.entry = std::acos(2.0 * 1e-3 / 20e-3 - 1.0);
  parameters.exit = units::PI;
  parameters.speed_low = units::radPerSecFromRpm(8000.0);
  parameters.speed_high = units::radPerSecFromRpm(16000.0);
  parameters.speeds = 161;
  parameters.surface_tolerance = tolerance;
  ChartMaker maker = fromModes(parameters, 0.01);
  CoefficientSet identified = coefficients();
  identified.value.krc = 2e8;
  identified.value.kre = 1e4;
  maker.handle(identified);
  return maker;
}

// Walls by the solution that is compared with the time domain (surface_error_test), at the feed of the chart.
TEST(ChartMaker, finishingCutsMakeSizeAtAllSpeedsOfTheMargin) {
  const StabilityChart any = finishing(0.0).chart();
  const auto worst = [&](const ChartMaker& maker, const StabilityPoint& cut) {
    RegenerativeSystem system = *maker.system({});
    system.chip.emplace();
    system.chip->feed = ChartParameters().feed_per_tooth;
    system.chip->kte = system.chip->kre = 1e4;
    double error = 0.0;
    for (const double side : {0.99, 1.0, 1.01})
      error = std::max(error,
                       std::abs(WallPrediction(system).at(side * cut.spindle_speed, cut.axial_depth).error));
    return error;
  };
  double largest = 0.0;
  for (const StabilityPoint& cut : any.recommended) largest = std::max(largest, worst(finishing(0.0), cut));
  const double tolerance = 0.3 * largest;
  const ChartMaker maker = finishing(tolerance);
  const StabilityChart chart = maker.chart();
  ASSERT_FALSE(chart.recommended.empty());
  for (const StabilityPoint& cut : chart.recommended) EXPECT_LT(worst(maker, cut), tolerance);
  EXPECT_LT(chart.recommended[0].material_removal_rate, any.recommended[0].material_removal_rate);
  EXPECT_TRUE(finishing(1e-9).chart().recommended.empty());
  EXPECT_EQ(chart.limit.depth, any.limit.depth);
}

TEST(ChartMaker, aToleranceOfTheSurfaceRequiresEdgeCoefficientsAndOneWall) {
  ChartMaker maker = finishing(10e-6);
  maker.handle(coefficients());
  EXPECT_EQ(maker.missing(), "edge coefficients (surface_tolerance)");
  ChartParameters both = slot();
  both.surface_tolerance = 10e-6;
  EXPECT_THROW(ChartMaker(both, machine()), Error);
}

TEST(ChartMaker, listsMissingInputs) {
  ChartMaker maker(slot(), machine());
  EXPECT_EQ(maker.missing(), "FRF in x, FRF in y, tangential coefficient");
  maker.handle(frf("x", 5.0));
  maker.handle(coefficients());
  EXPECT_EQ(maker.missing(), "FRF in y");
  EXPECT_THROW(maker.chart(), Error);
  MeasuredFrf sensor = frf("y", 5.0);
  sensor.point = POINT_FORCE_SENSOR;
  maker.handle(sensor);
  EXPECT_EQ(maker.missing(), "FRF in y");
  MeasuredFrf other = frf("y", 5.0);
  other.tool = "face_mill";
  maker.handle(other);
  EXPECT_EQ(maker.missing(), "FRF in x");  // another tool: the FRF of the first one is discarded
}

TEST(ChartMaker, errorsNameTheInvalidParameter) {
  const auto message = [](const std::function<void(ChartParameters&)>& change) -> std::string {
    ChartParameters parameters = slot();
    change(parameters);
    try {
      ChartMaker maker(parameters, machine());
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(message([](ChartParameters&) {}), "");
  EXPECT_NE(message([](ChartParameters& p) { p.exit = -1.0; }).find("exit_angle: -1 "), std::string::npos);
  EXPECT_NE(message([](ChartParameters& p) { p.depth_margin = 1.0; }).find("depth_margin"),
            std::string::npos);
  EXPECT_NE(message([](ChartParameters& p) { p.radial_ratio = std::nan(""); }).find("kr"), std::string::npos);
  EXPECT_NE(message([](ChartParameters& p) { p.speed_low = 1e5; }).find("speed_high"), std::string::npos);
  MachineModel without = machine();
  without.tool.reset();
  EXPECT_THROW(ChartMaker(slot(), without), Error);
  EXPECT_THROW(filled(slot()).predict(0.0, 1e-3), Error);
  EXPECT_THROW(filled(slot()).predict(100.0, std::nan("")), Error);
}

}  // namespace
}  // namespace smartmill::stability
