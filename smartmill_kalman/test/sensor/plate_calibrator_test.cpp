#include "smartmill_kalman/sensor/plate_calibrator.h"

#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/signal/force_channels.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/compensation/compensation_pipeline.h"
#include "smartmill_kalman_testing/plate_sensor.h"

namespace smartmill::kalman {
namespace {

constexpr double RATE = 25600.0;       // [Hz]
constexpr double BANDWIDTH = 5000.0;   // [Hz]
constexpr std::size_t LENGTH = 10240;  // samples of a tap: 0.4 s
constexpr std::size_t BLOCK = 256;     // samples

/// Taps of the closed-form plate, through the streams: the goal sets the point, hammer and plate are blocks.
class Taps {
 public:
  explicit Taps(PlateCalibrator& calibrator, const TapParameters& parameters)
      : calibrator_(calibrator), parameters_(parameters) {}

  void hit(const std::array<double, 3>& point, std::size_t axis, bool reference) {
    CalibrationGoal goal;
    goal.step = CalibrationGoal::Step::point;
    goal.load = point;
    goal.reference = reference;
    EXPECT_EQ(calibrator_.handle(goal).code, CalibrationResult::Code::ok);
    std::array<std::vector<double>, 3> force;
    for (auto& component : force) component.assign(LENGTH, 0.0);
    std::normal_distribution<double> noise(0.0, 0.05);  // [N] of the hammer
    std::vector<double> hammer(LENGTH);
    std::size_t trigger = LENGTH;
    for (std::size_t i = 0; i < LENGTH; ++i) {
      const double t = static_cast<double>(i) / RATE - 0.1, contact = 2.0e-4;
      if (t > 0.0 && t < contact)
        force[axis][i] = 300.0 * std::pow(std::sin(units::TWO_PI / 2.0 * t / contact), 2);
      hammer[i] = force[axis][i] + noise(random_);
      if (trigger == LENGTH && hammer[i] > parameters_.trigger_force) trigger = i;
    }
    const auto measured = PlateSensor().measure(force, point, RATE, 6, random_);
    static const char* const DIRECTIONS[] = {"x", "y", "z"};
    calibrator_.beginTaps(DIRECTIONS[axis]);
    for (std::size_t from = 0; from < LENGTH; from += BLOCK) {
      SampleBlock hammer_block, plate_block;
      for (SampleBlock* block : {&hammer_block, &plate_block}) {
        block->stamp = static_cast<double>(index_ + from) / RATE;
        block->sample_rate = RATE;
        block->first_index = index_ + from;
      }
      hammer_block.channels = {"hammer"};
      hammer_block.units = {"N"};
      plate_block.channels.assign(PLATE_CHANNELS.begin(), PLATE_CHANNELS.end());
      plate_block.units = {"N", "N", "N", "N m", "N m", "N m"};
      for (std::size_t i = from; i < from + BLOCK; ++i) {
        hammer_block.samples.push_back(hammer[i]);
        for (const auto& channel : measured) plate_block.samples.push_back(channel[i]);
      }
      calibrator_.handle(plate_block);
      calibrator_.handleHammer(hammer_block);
    }
    SensorResult result;
    result.static_gain = 1.0;
    result.hit_stamps = {static_cast<double>(index_ + trigger) / RATE};
    calibrator_.endTaps(result);
    index_ += LENGTH;
  }

  void hitEveryPoint() {
    for (const double a : {-0.03, 0.03}) {
      for (const double b : {-0.025, 0.025}) hit({a, b, 0.03}, 2, false);
      hit({0.045, 0.6 * a, 0.012}, 0, false);
      hit({0.045, -0.6 * a, 0.028}, 0, false);
      hit({0.6 * a, -0.04, 0.012}, 1, false);
      hit({-0.6 * a, -0.04, 0.028}, 1, false);
    }
  }

 private:
  PlateCalibrator& calibrator_;
  TapParameters parameters_;
  std::mt19937 random_{11};
  std::uint64_t index_ = 0;
};

CalibrationResult step(PlateCalibrator& calibrator, CalibrationGoal::Step kind) {
  CalibrationGoal goal;
  goal.step = kind;
  return calibrator.handle(goal);
}

TEST(PlateCalibrator, FitsAndIsComparedWithTheHammerAtOtherPoints) {
  using Step = CalibrationGoal::Step;
  using Code = CalibrationResult::Code;
  const TapParameters parameters;
  PlateCalibrator calibrator(parameters, BANDWIDTH);
  EXPECT_EQ(step(calibrator, Step::fit).code, Code::fit_failed);
  EXPECT_EQ(step(calibrator, Step::verify).message, "verify: the plate is not calibrated");
  Taps taps(calibrator, parameters);
  taps.hitEveryPoint();
  const CalibrationResult found = step(calibrator, Step::fit);
  ASSERT_EQ(found.code, Code::ok) << found.message;
  EXPECT_EQ(found.readings, 12u);
  ASSERT_TRUE(found.matrix);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    // Up to 250 Hz the feet of a plate of 3 kHz measure the force to (250 / 3000)^2 = 0.7 %.
    EXPECT_NEAR(found.constant[axis], 1.0, 0.01);
    EXPECT_LT(found.constant_std[axis], 0.01);
    EXPECT_GT(found.error[axis], 0.0);
    EXPECT_LT(found.error[axis], 0.05);
  }
  calibrator.use(*found.matrix, BANDWIDTH);
  EXPECT_EQ(step(calibrator, Step::verify).message, "verify: no taps at a point with reference");
  taps.hit({0.045, 0.0, 0.02}, 0, true);
  taps.hit({0.0, -0.04, 0.02}, 1, true);
  taps.hit({0.0, 0.0, 0.03}, 2, true);
  const CalibrationResult verified = step(calibrator, Step::verify);
  EXPECT_EQ(verified.code, Code::ok) << verified.message;
  EXPECT_TRUE(verified.verified);
  EXPECT_EQ(verified.readings, 3u);
  for (const double error : verified.error) EXPECT_LT(error, 0.05) << verified.message;
  EXPECT_EQ(calibrator.taps().taps.size(), 12u);  // reference taps are not fitted
}

TEST(PlateCalibrator, AMatrixThatIsWrongByTenPercentDoesNotVerify) {
  const TapParameters parameters;
  PlateCalibrator calibrator(parameters, BANDWIDTH);
  Taps taps(calibrator, parameters);
  taps.hitEveryPoint();
  const CalibrationResult found = step(calibrator, CalibrationGoal::Step::fit);
  ASSERT_TRUE(found.matrix) << found.message;
  TransferMatrix wrong = *found.matrix;
  for (auto& line : wrong.forward) line *= 1.1;
  calibrator.use(wrong, BANDWIDTH);
  taps.hit({0.045, 0.0, 0.02}, 0, true);
  const CalibrationResult verified = step(calibrator, CalibrationGoal::Step::verify);
  EXPECT_EQ(verified.code, CalibrationResult::Code::fit_failed);
  EXPECT_NEAR(verified.error[0], 1.0 - 1.0 / 1.1, 0.02) << verified.message;
  EXPECT_TRUE(std::isnan(verified.error[1]));
}

SampleBlock plateBlock(int number, double fy) {
  SampleBlock block;
  block.stamp = 0.01 * number;
  block.sample_rate = RATE;
  block.first_index = 256 * static_cast<std::uint64_t>(number);
  block.channels = {"fx", "fy", "fz"};
  block.units.assign(3, "N");
  for (int i = 0; i < 256; ++i) {
    for (const double f : {0.1 * i, fy, -0.1 * i}) block.samples.push_back(f);
  }
  return block;
}

TEST(CompensationPipeline, APlateGivesNoForceBeforeItsMatrix) {
  std::size_t forces = 0;
  const auto count = [&](const ForceBlock&) { ++forces; };
  CompensationPipeline pipeline({}, {}, {}, 0.05, {{count, count}});
  pipeline.useKind(ForceSensorKind::plate);
  for (int b = 0; b < 100; ++b) pipeline.push(plateBlock(b, 0.0));
  pipeline.flush();
  EXPECT_EQ(forces, 0u);
  EXPECT_FALSE(pipeline.identification().calibration().calibrated);
}

}  // namespace
}  // namespace smartmill::kalman
