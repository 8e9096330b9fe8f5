#include "smartmill_hammer/search/sensor_calibration.h"

#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/testing/coverage.h"

namespace smartmill::hammer {
namespace {

struct Sensor {
  double gap0 = 250e-6, gain = 10.0, range = 10.0;
  double volt(double gap) const { return std::max(-range, std::min(range, gain * (gap0 / gap - 1.0))); }
  /// Displacement per volt [m/V] at a gap.
  double sensitivity(double gap) const { return gap * gap / (gain * gap0); }
};

struct Outcome {
  SensorCalibration calibration;
  double gap, closest;
};

Outcome run(const SensorCalibrationOptions& options, double gap, double noise, std::uint32_t seed) {
  const Sensor sensor;
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Outcome o{SensorCalibration(options), gap, gap};
  const auto read = [&] { return sensor.volt(o.gap) + noise * normal(random); };
  o.calibration.start(read(), noise);
  while (o.calibration.state() == SensorCalibration::State::jogging) {
    o.gap -= o.calibration.nextJog() + options.position_std * normal(random);
    o.closest = std::min(o.closest, o.gap);
    o.calibration.addVoltage(read(), noise);
  }
  return o;
}

// On the sensor's true curve the sensitivity is gap^2 / (gain gap0); the error of the symmetric measurement
// of
// +-10 um is (10/250)^2 = 0.16 % at most, voltage noise of 0.3 mV over 0.8 V by 0.05 %, a position error of
// 0.1 um by 0.7 %.
TEST(SensorCalibration, ZeroesTheNonlinearSensorAndFindsItsSensitivity) {
  const SensorCalibrationOptions options;
  for (const double gap : {300e-6, 500e-6, 900e-6, 1.5e-3, 2.5e-3, 245e-6, 200e-6}) {
    SensorCalibrationOptions exact = options;
    exact.position_std = 0.0;
    const Outcome o = run(exact, gap, 0.0, 1);
    ASSERT_EQ(o.calibration.state(), SensorCalibration::State::done) << gap << ": " << o.calibration.reason();
    EXPECT_NEAR(o.gap, 250e-6, 4e-6) << gap;
    EXPECT_NEAR(o.calibration.result().sensitivity, Sensor().sensitivity(o.gap),
                0.003 * Sensor().sensitivity(o.gap))
        << gap;
    EXPECT_GE(o.closest, std::min(gap, 235e-6)) << gap;
  }
}

// Eq. 4.8, 4.9: first 50 um, then half the remaining distance, never more than 100 um.
TEST(SensorCalibration, JogsAsTheThesisDoes) {
  SensorCalibration c{SensorCalibrationOptions()};
  const Sensor sensor;
  c.start(sensor.volt(900e-6), 1e-4);
  EXPECT_DOUBLE_EQ(c.nextJog(), 50e-6);
  c.addVoltage(sensor.volt(850e-6), 1e-4);
  EXPECT_NEAR(c.nextJog(), 100e-6, 1e-12);
  SensorCalibration near{SensorCalibrationOptions()};
  near.start(sensor.volt(350e-6), 1e-4);
  near.addVoltage(sensor.volt(300e-6), 1e-4);
  const double slope = (sensor.volt(300e-6) - sensor.volt(350e-6)) / 50e-6;
  EXPECT_NEAR(near.nextJog(), 0.5 * -sensor.volt(300e-6) / slope, 0.5e-6);
}

// A protruding edge touches the sensor's face while the electrode faces the flank behind it: no further jog.
TEST(SensorCalibration, StopsWhereTheRangeEndsThoughTheCurveLeavesRoom) {
  SensorCalibration c{SensorCalibrationOptions()};
  const Sensor sensor;
  c.start(sensor.volt(500e-6), 1e-4);
  c.addVoltage(sensor.volt(450e-6), 1e-4);
  ASSERT_GT(c.nextJog(), 0.0);
  c.addVoltage(9.99, 1e-4);
  ASSERT_EQ(c.state(), SensorCalibration::State::failed);
  EXPECT_THAT(c.reason(), ::testing::HasSubstr("to the end of its range: a point of the tool is nearer"));
}

TEST(SensorCalibration, StandardDeviationIsHonest) {
  const SensorCalibrationOptions options;
  Coverage sensitivity;
  for (int i = 0; i < Coverage::RUNS; ++i) {
    const Outcome o = run(options, 700e-6, 1e-3, 100u + static_cast<std::uint32_t>(i));
    ASSERT_EQ(o.calibration.state(), SensorCalibration::State::done) << o.calibration.reason();
    const double truth = Sensor().sensitivity(o.gap + 0.0);
    sensitivity.add(o.calibration.result().sensitivity - truth, o.calibration.result().sensitivity_std);
  }
  EXPECT_TRUE(sensitivity.isCalibrated());
}

TEST(SensorCalibration, RefusesWhatIsNoSensor) {
  // Dead sensor: constant voltage.
  SensorCalibration dead{SensorCalibrationOptions()};
  dead.start(-3.0, 1e-4);
  dead.addVoltage(-3.0, 1e-4);
  EXPECT_EQ(dead.state(), SensorCalibration::State::failed);
  // Inverted: the voltage falls when the tool comes nearer.
  SensorCalibration wrong{SensorCalibrationOptions()};
  wrong.start(-3.0, 1e-4);
  wrong.addVoltage(-3.5, 1e-4);
  EXPECT_EQ(wrong.state(), SensorCalibration::State::failed);
  // Out of range: the approach ends after max_travel.
  SensorCalibration far{SensorCalibrationOptions()};
  far.start(-10.0, 1e-4);
  while (far.state() == SensorCalibration::State::jogging) far.addVoltage(-10.0, 1e-4);
  EXPECT_LE(far.travelled(), SensorCalibrationOptions().max_travel + 1e-9);
  EXPECT_NE(far.reason().find("out of the sensor's range"), std::string::npos);
}

// A sensor whose curve is not the nominal hyperbola, as in front of a round tool.
TEST(SensorCalibration, MeasuresTheCurveItself) {
  const auto volt = [](double gap) { return std::clamp(0.8 * 10.0 * 180e-6 / gap - 9.0, -10.0, 10.0); };
  SensorCalibrationOptions options;
  options.position_std = 0.0;
  SensorCalibration c{options};
  double gap = 700e-6;
  c.start(volt(gap), 1e-5);
  while (c.state() == SensorCalibration::State::jogging) {
    gap -= c.nextJog();
    c.addVoltage(volt(gap), 1e-5);
  }
  ASSERT_EQ(c.state(), SensorCalibration::State::done) << c.reason();
  EXPECT_LT(std::abs(c.volt()), 0.1);
  EXPECT_FALSE(c.result().limited_by_edges);
  EXPECT_NEAR(c.result().curve_gap / gap, 1.0, 1e-6);
  const double slope = 0.8 * 10.0 * 180e-6 / (gap * gap);
  EXPECT_NEAR(c.result().sensitivity * slope, 1.0, 1e-6);
}

// Edges next to the sensor extend further than the surface in front of it.
TEST(SensorCalibration, EndsWhereTheToolWouldTouch) {
  const Sensor sensor;
  SensorCalibrationOptions options;
  options.safe_travel = 200e-6;
  double gap = 700e-6;
  const double begin = gap;
  SensorCalibration c{options};
  c.start(sensor.volt(gap), 1e-4);
  while (c.state() == SensorCalibration::State::jogging) {
    gap -= c.nextJog();
    ASSERT_LE(begin - gap, 200e-6 + 1e-9);
    c.addVoltage(sensor.volt(gap), 1e-4);
  }
  ASSERT_EQ(c.state(), SensorCalibration::State::done) << c.reason();
  EXPECT_TRUE(c.result().limited_by_edges);
  EXPECT_NEAR(c.result().sensitivity / sensor.sensitivity(gap), 1.0, 0.01);
  EXPECT_GT(c.result().sensitivity_std, 0.0);
}

// An edge of a tenth of the electrode's width: the voltage is zero only just before contact.
TEST(SensorCalibration, DoesNotTouchWithASharpEdge) {
  SensorCalibrationOptions options;
  options.min_gap = 125e-6;
  double gap = 520e-6, closest = gap;
  const auto volt = [](double g) {
    return std::clamp(10.0 * (250e-6 * (0.1 / g + 0.9 / (g + 900e-6)) - 1.0), -10.0, 10.0);
  };
  SensorCalibration c{options};
  c.start(volt(gap), 1e-4);
  while (c.state() == SensorCalibration::State::jogging) {
    gap -= c.nextJog();
    closest = std::min(closest, gap);
    c.addVoltage(volt(gap), 1e-4);
  }
  EXPECT_GT(closest, 40e-6);
}

TEST(SensorCalibration, NeverJogsBelowTheLeastGap) {
  SensorCalibrationOptions options;
  options.min_gap = 245e-6;
  options.check_jog = 10e-6;
  const Outcome o = run(options, 600e-6, 1e-4, 7);
  EXPECT_EQ(o.calibration.state(), SensorCalibration::State::failed);
  EXPECT_GE(o.closest, 244e-6);
}

}  // namespace
}  // namespace smartmill::hammer
