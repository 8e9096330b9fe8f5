#include "kalman/spindle_rig.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <gtest/gtest.h>

#include "kalman/bistable.h"
#include "kalman/burzoni_tables.h"
#include "kalman/expanded_disturbance.h"
#include "smartmill_core/error.h"
#include "smartmill_core/testing/reference_case.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

constexpr double LENGTH = 0.139;  // [m]

// Weights, reference, taps and a cut: the spindle sensor of the simulated machine through the steps of the
// product.
TEST(SpindleRig, ShowsTheForceOfACutAfterItsCalibration) {
  const MachineModel model = readMachineModel("../../launch/models/mill_twin.yaml");
  sim::WorldOptions world;
  world.spindle_sensor.present = true;
  CompensationParameters filter;
  filter.filter.bandwidth = 2500.0;
  TapParameters taps;
  taps.fit_high = 2500.0;
  SpindleRig rig(model, world, filter, taps, false);
  rig.sorted().forces().spindle().setLength(LENGTH);
  rig.publishCondition(CuttingCondition::Kind::none);
  rig.readStatic({0.110, LENGTH, 0.170}, {0.0, 150.0, 300.0, 0.0}, false);
  CalibrationGoal fit;
  fit.step = CalibrationGoal::Step::fit;
  const auto found = rig.ask(fit).calibration;
  ASSERT_TRUE(found);
  // The reciprocal sensitivity of a beam is linear in the length; the fit agrees with the measurements.
  EXPECT_TRUE(found->x.reciprocal);
  EXPECT_NEAR(found->x.at(LENGTH), 18.0, 0.2);  // Burzoni Table 2
  // No extrapolation beyond the calibrated lengths.
  EXPECT_THROW(SpindleForceSensor(*found, 0.25), Error);
  rig.readStatic({0.125}, {0.0, 150.0, 300.0, 0.0}, true);
  CalibrationGoal verify;
  verify.step = CalibrationGoal::Step::verify;
  const CalibrationResult verified = rig.ask(verify);
  for (const double e : verified.error) EXPECT_LT(e, 0.05);  // Burzoni 3.2.1
  rig.world().setToolLength(LENGTH);
  rig.run(0.3);
  for (const char* direction : {"y", "x", "z"}) EXPECT_EQ(rig.tap(direction, 5).code, FrfCode::ok);
  ASSERT_TRUE(rig.ask(fit).calibration);
  const auto cut = cutSlot(rig, model, units::radPerSecFromRpm(6000.0), 0.8e-3, 0.1e-3, 0.6, 0.4);
  const std::size_t n = cut.compensated[2].size();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto error = [&](const auto& force) {
      return bandError(force[axis], cut.truth[axis], sim::World::SAMPLE_RATE, n / 10, n - n / 10, 2500.0);
    };
    EXPECT_GT(error(cut.measured), 0.08);
    EXPECT_LT(error(cut.compensated), 0.04);
  }
  // A missing channel gives an error message.
  SampleBlock block;
  block.channels = {"x1", "x2", "y1", "y2", "z1"};
  block.units.assign(5, "N");
  EXPECT_THROW(SpindleForceSensor(*found, LENGTH).handle(block), Error);
}

// Eq. 4-43: a constant and an oscillation at tooth passing are estimated without error; another harmonic is
// not.
TEST(ExpandedDisturbance, TellsWhatItIsMadeFor) {
  constexpr double RATE = 25600.0;
  ModalModel sensor;
  sensor.modes.push_back({930.0, 0.04, 0.8});
  sensor.direct = 0.2;
  const auto error = [&](double f) {
    ModalFilter plant(sensor, RATE, Hold::first_order);
    std::vector<double> measured, truth;
    for (int i = 0; i < 25600; ++i) {
      truth.push_back(50.0 + 100.0 * std::cos(units::TWO_PI * f * i / RATE));
      measured.push_back(plant.step(truth.back()));
    }
    const auto force = expandedDisturbanceForce(measured, sensor, RATE, 400.0, std::pow(2.0, 20), 1.0);
    double sum = 0.0;
    for (std::size_t i = 20000; i < truth.size(); ++i) sum += std::pow(force[i] - truth[i], 2);
    return std::sqrt(sum / 5600.0);
  };
  EXPECT_LT(error(400.0), 1.0);
  EXPECT_GT(error(1600.0), 3.0);
}

// The filter depends on Q over R alone: R times 64 multiplies the best Q by 64. That Q falls as the noise of
// the taps rises.
TEST(ExpandedDisturbance, TheBestQFollowsRAndTheNoiseOfTheTaps) {
  constexpr double RATE = 25600.0, R = 0.15, BAND = 2500.0;
  ModalModel sensor;
  sensor.modes.push_back({930.0, 0.04, 0.8});
  sensor.direct = 0.2;
  ReferenceTaps taps;
  for (int tap = 0; tap < 5; ++tap) {
    ModalFilter plant(sensor, RATE, Hold::first_order);
    taps.hammer.emplace_back();
    taps.response.emplace_back();
    for (int i = 0; i < 5120; ++i) {
      taps.hammer.back().push_back(i >= 256 && i < 270 ? 300.0 * std::sin(units::PI * (i - 256) / 14.0)
                                                       : 0.0);
      taps.response.back().push_back(plant.step(taps.hammer.back().back()));
    }
  }
  const std::vector<double> speeds{units::radPerSecFromRpm(1000.0)};
  const auto best = [&](double noise, double r) {
    return expandedTapMap(withNoise(taps, noise * std::sqrt(R), 3), sensor, RATE, r, speeds, 4, BAND)
        .best(speeds.front());
  };
  const int tenfold = best(10.0, R), hundredfold = best(100.0, R);
  EXPECT_GT(best(1.0, R), tenfold);
  EXPECT_GT(tenfold, hundredfold);
  EXPECT_GT(hundredfold, LEAST_EXPONENT);
  EXPECT_EQ(best(10.0, 64.0 * R), tenfold + 6);
}

/// A law of given coefficients over 0 .. 1 mm.
ForceCurve law(double power) {
  ForceCurve curve;
  for (int k = 0; k <= 8; ++k) curve.knots.push_back(1e-3 * k / 8);
  curve.std_dev.assign(9, 0.0);
  // Greville's abscissae: a linear law is represented exactly.
  for (int k = 0; k < 11; ++k) {
    const double x = (std::clamp(k - 2, 0, 8) + std::clamp(k - 1, 0, 8) + std::clamp(k, 0, 8)) / 24.0 * 1e-3;
    curve.value.push_back(100e3 * std::pow(x / 1e-4, power));
  }
  return curve;
}

// Linear law: the critical limit is 1 / (2 K zeta (1 + zeta) gain) (Tlusty), with almost no bistable zone; a
// digressive law has one.
TEST(Bistable, LinearLawHasTheTextbookLimitAndADigressiveOneARange) {
  Mode mode;
  mode.frequency = 800.0;
  mode.damping_ratio = 0.02;
  mode.gain = 1e-7;
  std::vector<double> speeds;
  for (double rpm = 14000.0; rpm <= 20000.0; rpm += 1000.0) speeds.push_back(units::radPerSecFromRpm(rpm));
  const auto least = [&](double power) {
    const auto points = bistableRange(law(power), mode, 2, 0.1e-3, speeds, 3.0, 30e-3);
    return *std::min_element(points.begin(), points.end(),
                             [](const auto& a, const auto& b) { return a.small < b.small; });
  };
  const BistablePoint linear = least(1.0), digressive = least(0.5);
  const double due = 2.0 * 0.02 * 1.02 / (1e-7 * 1e9);
  EXPECT_NEAR(linear.small, due, 0.1 * due);
  EXPECT_GT(linear.large, 0.9 * linear.small);
  EXPECT_LT(digressive.large, 0.9 * digressive.small);
}

// Kurtosis of a uniform distribution 1.8, of a sine 1.5.
TEST(ExpandedDisturbance, KurtosisOfKnownDistributions) {
  std::vector<double> uniform, sine;
  for (int i = 0; i < 10000; ++i) {
    uniform.push_back(i);
    sine.push_back(std::sin(units::TWO_PI * i / 10000.0));
  }
  EXPECT_NEAR(kurtosis(uniform), 1.8, 1e-6);
  EXPECT_NEAR(kurtosis(sine), 1.5, 1e-6);
}

// The same slot with the dynamometer turned by 30 degrees about z: forces carried into the machine's axes.
TEST(SpindleRig, ATurnedDynamometerGivesTheSameForces) {
  std::array<std::array<double, 3>, 2> error{};
  for (const bool turned : {false, true}) {
    MachineModel model = readMachineModel("../../launch/models/mill_twin.yaml");
    if (turned)
      model.frames["dynamometer"] = {
          "table", {{0.05, 0.02, 0.0}}, {{0.0, 0.0, std::sin(units::PI / 12.0), std::cos(units::PI / 12.0)}}};
    const PlacedFrame placed = placedFrame(model.frames, "dynamometer", "machine");
    SpindleRig rig(model, {}, {}, {}, true);
    for (std::size_t axis = 0; axis < 3; ++axis)
      rig.sorted().forces().setModes(axis, 0.0, model.force_sensor.axis[axis], 1.0);
    auto cut = cutSlot(rig, model, units::radPerSecFromRpm(6000.0), 0.8e-3, 0.1e-3, 0.6, 0.4);
    const std::size_t n = cut.compensated[2].size();
    if (turned) {
      // Without the rotation x differs.
      EXPECT_GT(
          bandError(cut.compensated[0], cut.truth[0], sim::World::SAMPLE_RATE, n / 10, n - n / 10, 5000.0),
          0.2);
    }
    for (std::size_t i = 0; i < n; ++i) {
      std::array<double, 3> force{{cut.compensated[0][i], cut.compensated[1][i], cut.compensated[2][i]}},
          moment{};
      placed.carry(force, moment);
      for (std::size_t axis = 0; axis < 3; ++axis) cut.compensated[axis][i] = force[axis];
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      error[turned ? 1 : 0][axis] = bandError(cut.compensated[axis], cut.truth[axis], sim::World::SAMPLE_RATE,
                                              n / 10, n - n / 10, 5000.0);
    }
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::printf("axis %zu: error %.2f %% aligned, %.2f %% turned by 30 degrees\n", axis,
                100.0 * error[0][axis], 100.0 * error[1][axis]);
  }
  // The rotation mixes the errors of x and y, whose size stays.
  EXPECT_LT(std::hypot(error[1][0], error[1][1]), 1.1 * std::hypot(error[0][0], error[0][1]));
  EXPECT_LT(error[1][2], error[0][2] + 0.002);
}

// A slot compensated with the angle of the encoder and with one pulse per revolution.
TEST(SpindleRig, PulsesGiveTheForcesOfTheAngle) {
  const MachineModel model = readMachineModel("../../launch/models/mill_twin.yaml");
  for (const double rpm : {3000.0, 6000.0, 12000.0}) {
    std::array<std::array<double, 3>, 2> error{};
    std::array<std::vector<double>, 3> by_angle;
    for (const bool pulses : {false, true}) {
      sim::WorldOptions world;
      world.pulse_train = pulses;
      SpindleRig rig(model, world, {}, {}, true);
      for (std::size_t axis = 0; axis < 3; ++axis)
        rig.sorted().forces().setModes(axis, 0.0, model.force_sensor.axis[axis], 1.0);
      const auto cut = cutSlot(rig, model, units::radPerSecFromRpm(rpm), 0.8e-3, 0.1e-3, 0.6, 0.4);
      const std::size_t n = cut.compensated[2].size();
      ASSERT_GT(n, 8000u);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        error[pulses ? 1 : 0][axis] = bandError(cut.compensated[axis], cut.truth[axis],
                                                sim::World::SAMPLE_RATE, n / 10, n - n / 10, 5000.0);
        if (pulses) {
          const double difference = bandError(cut.compensated[axis], by_angle[axis], sim::World::SAMPLE_RATE,
                                              n / 10, n - n / 10, 5000.0);
          std::printf(
              "%5.0f rpm, axis %zu: error %.2f %% by the angle, %.2f %% by pulses, difference %.4f %%\n", rpm,
              axis, 100.0 * error[0][axis], 100.0 * error[1][axis], 100.0 * difference);
          // Not passed through: the output of the sensor differs.
          EXPECT_GT(bandError(cut.measured[axis], cut.compensated[axis], sim::World::SAMPLE_RATE, n / 10,
                              n - n / 10, 5000.0),
                    axis == 2 ? 0.002 : 0.1);
          EXPECT_LT(difference, 0.01);
          EXPECT_LT(error[1][axis], error[0][axis] + 0.005);
        }
      }
      if (!pulses) by_angle = cut.compensated;
    }
  }
}

}  // namespace
}  // namespace smartmill::kalman
