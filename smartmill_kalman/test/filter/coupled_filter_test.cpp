#include "smartmill_kalman/filter/coupled_filter.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/cutting/rigid_cut.h"
#include "smartmill_core/error.h"
#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/testing/force_block.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/compensation/force_compensation.h"
#include "smartmill_kalman_testing/reference_case.h"

namespace smartmill::kalman {
namespace {

constexpr double RATE = 25600.0;  // [Hz]

ModalModel own(double frequency) {
  ModalModel model;
  model.modes = {{frequency, 0.03, 0.9}};
  model.direct = 0.1;
  return model;
}

/// 8 % of y's signal in x, and x's mode showing in y.
SensorMatrix sensor() {
  SensorMatrix matrix;
  for (std::size_t i = 0; i < 3; ++i) matrix.h[i][i] = own(930.0 + 150.0 * static_cast<double>(i));
  matrix.h[0][1] = matrix.h[1][1];
  matrix.h[0][1].modes[0].gain *= 0.08;
  matrix.h[0][1].direct *= 0.08;
  matrix.h[1][0].modes = {{930.0, 0.03, 0.05}};
  return matrix;
}

TEST(SensorMatrix, ConditionOfADiagonalMatrixIsTheRatioOfItsGains) {
  SensorMatrix matrix;
  for (std::size_t i = 0; i < 3; ++i) matrix.h[i][i].direct = 1.0 / static_cast<double>(i + 1);
  EXPECT_NEAR(matrix.condition(100.0), 3.0, 1e-12);
  EXPECT_NEAR(sensor().response(0.0)[0][1].real(), 0.08, 1e-12);
}

TEST(CoupledFilter, TakesTheCrossTalkOut) {
  const SensorMatrix matrix = sensor();
  const double speed = units::radPerSecFromRpm(9000.0);
  const ToolGeometry tool{4, 16e-3, units::radFromDeg(30.0), {}};
  CuttingLaw law;
  law.coefficients = {800e6, 250e6, 0.0, 20e3, 20e3, 0.0};
  RigidCut process(tool, law, Engagement{0.0, units::PI, 2e-3, 6e-5}, runoutRadii(tool, 8e-6, 0.5));
  std::vector<ModalFilter> path;
  for (const auto& row : matrix.h) {
    for (const ModalModel& h : row) path.emplace_back(h, 4.0 * RATE, Hold::first_order);
  }
  CoupledFilter coupled(matrix, speed, RATE, {});
  HarmonicFilter alone(matrix.h[0][0], speed, RATE, {});
  std::mt19937 random(2);
  std::normal_distribution<double> noise(0.0, 0.3);
  std::array<std::vector<double>, 3> applied, found;
  std::vector<double> single;
  for (int i = 0; i < 12800; ++i) {
    std::array<double, 3> measured{}, truth{};
    for (int fine = 3; fine >= 0; --fine) {
      const CuttingForce f = process.at(speed * (i - 0.25 * fine) / RATE);
      truth = {f.fx, f.fy, 20.0 + 0.3 * f.fy};
      measured = {};
      for (std::size_t r = 0; r < 3; ++r) {
        for (std::size_t c = 0; c < 3; ++c) measured[r] += path[3 * r + c].step(truth[c]);
      }
    }
    for (double& m : measured) m += noise(random);
    const auto force = coupled.step(measured);
    single.push_back(alone.step(measured[0]));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      applied[axis].push_back(truth[axis]);
      found[axis].push_back(force[axis]);
    }
  }
  // Up to 2.5 kHz: at its zero near 2940 Hz the sensor shows nothing.
  for (std::size_t axis = 0; axis < 3; ++axis)
    EXPECT_LT(bandError(found[axis], applied[axis], RATE, 6400, 12800, 2500.0), 0.015) << axis;
  EXPECT_GT(bandError(single, applied[0], RATE, 6400, 12800, 2500.0), 0.05);
}

TEST(CoupledFilter, RefusesAMatrixThatCannotBeInverted) {
  SensorMatrix matrix = sensor();
  matrix.h[0][1] = matrix.h[0][0];
  matrix.h[1][0] = matrix.h[1][1];
  EXPECT_THROW(CoupledFilter(matrix, 900.0, RATE, {}), Error);
}

TEST(SensorMatrix, FileKeepsEveryDigit) {
  const TemporaryFolder folder;
  writeSensorMatrix(sensor(), folder.file("matrix.yaml"));
  const SensorMatrix back = readSensorMatrix(folder.file("matrix.yaml"));
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j)
      EXPECT_EQ(back.h[i][j].response(777.0), sensor().h[i][j].response(777.0)) << i << j;
  }
  std::ofstream(folder.file("matrix.yaml"), std::ios::app) << "xy: {direct: 0.0}\n";
  EXPECT_THROW(readSensorMatrix(folder.file("matrix.yaml")), Error);
}

// Online, block by block: the same numbers as the coupled filter of whole records.
TEST(ForceCompensation, CoupledIsTheCoupledFilter) {
  const double speed =
      std::exp(0.01 * std::lround(100.0 * std::log(units::radPerSecFromRpm(9000.0))));  // on the grid
  CompensationParameters parameters;
  CoupledFilter whole(sensor(), speed, RATE, parameters.filter);
  std::vector<std::array<double, 3>> expected;
  std::vector<double> worst;
  ForceBlock measured;
  ForceOutputs outputs;
  outputs.measured = [&](const ForceBlock& block) { measured = block; };
  outputs.compensated = [&](const ForceBlock& compensated) {
    for (std::size_t i = 0; i < measured.force[0].size(); ++i) {
      const auto force = whole.step({measured.force[0][i], measured.force[1][i], measured.force[2][i]});
      for (std::size_t axis = 0; axis < 3; ++axis)
        worst.push_back(std::abs(force[axis] - compensated.force[axis][i]));
    }
  };
  ForceCompensation online(parameters, false, outputs);
  online.setMatrix(sensor());
  online.handle(SpindleAngle{0.0, 0.0, speed});
  std::mt19937 random(9);
  std::normal_distribution<double> noise(0.0, 1.0);
  for (int b = 0; b < 20; ++b) {
    SampleBlock block = forceBlock(0.01 * b, RATE, static_cast<std::uint64_t>(256 * b));
    for (int i = 0; i < 256; ++i) {
      const double phase = 4.0 * speed * (256 * b + i) / RATE;
      block.samples.insert(block.samples.end(),
                           {200.0 * std::cos(phase) + noise(random), 100.0 * std::sin(phase) + noise(random),
                            30.0 + noise(random)});
    }
    online.handle(block);
  }
  ASSERT_EQ(worst.size(), 3u * 256u * 20u);
  EXPECT_LT(*std::max_element(worst.begin(), worst.end()), 1e-9);
}

// Noisy FRFs; the three numbers of a fit hang together, so each is judged by itself.
TEST(FitCrossTalk, StandardDeviationsAreHonest) {
  const SensorMatrix matrix = sensor();
  std::mt19937 random(8);
  std::normal_distribution<double> noise(0.0, 0.01);
  Coverage first, second, direct;
  for (int run = 0; run < Coverage::RUNS; ++run) {
    FrequencyResponse frf;
    for (double f = 5.0; f < 3000.0; f += 5.0) {
      frf.frequency.push_back(f);
      frf.value.push_back(matrix.h[1][0].response(f) + std::complex<double>(noise(random), noise(random)));
      frf.std_dev.push_back(0.01 * std::sqrt(2.0));
    }
    const ModalModel fit = fitCrossTalk(frf, matrix.h[0][0], matrix.h[1][1], 100.0, 2900.0);
    ASSERT_EQ(fit.modes.size(), 2u);
    first.add(fit.modes[0].gain - 0.05, fit.modes[0].gain_std);
    second.add(fit.modes[1].gain, fit.modes[1].gain_std);
    direct.add(fit.direct, fit.direct_std);
  }
  EXPECT_TRUE(first.isCalibrated());
  EXPECT_TRUE(second.isCalibrated());
  EXPECT_TRUE(direct.isCalibrated());
}

}  // namespace
}  // namespace smartmill::kalman
