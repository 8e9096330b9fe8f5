#include "smartmill_kalman/tuning/memory_tuner.h"

#include <cmath>
#include <fstream>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/sensor/spindle_sensor_calibration.h"
#include "smartmill_kalman/tuning/tuning_records.h"

namespace smartmill::kalman {
namespace {

constexpr double RATE = 25600.0;

TunedMemory at(double rpm, std::optional<double> memory, double error) {
  return {units::radPerSecFromRpm(rpm), memory, error, 2.0 * error};
}

MemorySchedule exampleSchedule() {
  MemorySchedule schedule;
  for (auto& axis : schedule.axis)
    axis = {at(1000, 4.0, 1.0), at(4000, 1.0, 3.0), at(9000, std::nullopt, 5.0)};
  return schedule;
}

// Closed form: geometric mean at the geometric mean of the speeds.
TEST(MemorySchedule, InterpolatesOverTheLogarithmOfTheSpeed) {
  const MemorySchedule schedule = exampleSchedule();
  const auto speed = [](double rpm) { return units::radPerSecFromRpm(rpm); };
  EXPECT_NEAR(*schedule.memory(0, speed(2000)), 2.0, 1e-12);
  EXPECT_NEAR(*schedule.error(0, speed(2000)), 2.0, 1e-12);
  EXPECT_NEAR(*schedule.memory(2, speed(4000)), 1.0, 1e-12);
  EXPECT_FALSE(schedule.memory(0, speed(6000)));  // next to a speed with the fixed design
  EXPECT_NEAR(*schedule.error(0, speed(6000)), 4.0, 1e-12);
  EXPECT_FALSE(schedule.memory(0, speed(900)));
  EXPECT_FALSE(schedule.error(0, speed(9100)));
  EXPECT_FALSE(MemorySchedule().memory(0, speed(4000)));
}

TEST(MemorySchedule, IsKeptWithTheCalibration) {
  const TemporaryFolder temporary;
  const std::string file = temporary.file("memory_schedule.yaml");
  writeMemorySchedule(exampleSchedule(), file);
  const MemorySchedule read = readMemorySchedule(file);
  ASSERT_EQ(read.axis[2].size(), 3u);
  EXPECT_NEAR(*read.axis[2][0].memory, 4.0, 1e-9);
  EXPECT_FALSE(read.axis[2][2].memory);
  EXPECT_NEAR(read.axis[1][1].fixed_error, 6.0, 1e-9);
  SpindleSensorCalibration calibration = SpindleSensorCalibration::table3();
  writeSpindleSensor(calibration, file);
  EXPECT_TRUE(readSpindleSensor(file).memory.empty());  // a file without the section: fixed design
  calibration.memory = exampleSchedule();
  writeSpindleSensor(calibration, file);
  EXPECT_NEAR(readSpindleSensor(file).memory.axis[0][1].speed, units::radPerSecFromRpm(4000), 1e-6);
  std::ofstream(file) << "format: smartmill-memory/1\nmemory_over_speed:\n  x:\n"
                         "  - {speed_rpm: 2000.0, error_n: 1.0, fixed_error_n: 1.0}\n"
                         "  - {speed_rpm: 1000.0, error_n: 1.0, fixed_error_n: 1.0}\n";
  try {
    readMemorySchedule(file);
    FAIL();
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find("expected ascending speeds"), std::string::npos) << e.what();
  }
}

/// Two harmonics that begin after a quarter of the record, on a sensor with little response at the second.
struct Cut {
  TuningRecord record;
  std::vector<double> truth;
  std::array<SensorAxis, 3> sensor;
};

Cut cutWithNoise(double noise, double unmodelled) {
  Cut cut;
  cut.record.speed = units::TWO_PI * 150.0;
  cut.record.sample_rate = RATE;
  ModalModel model;
  model.modes.push_back({800.0, 0.03, 0.98});
  model.direct = 0.02;
  cut.sensor.fill({model, noise});
  std::mt19937_64 random(5);
  std::normal_distribution<double> draw(0.0, noise);
  for (int i = 0; i < 25600; ++i) {
    const double t = i / RATE;
    const double force = t < 0.25 ? 0.0
                                  : 60.0 + 50.0 * std::cos(4.0 * cut.record.speed * t) +
                                        2.0 * std::cos(24.0 * cut.record.speed * t) +
                                        unmodelled * std::cos(units::TWO_PI * 811.0 * t);
    cut.truth.push_back(force);
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    ModalFilter plant(model, RATE, Hold::first_order);
    for (const double force : cut.truth) {
      cut.record.cut[axis].push_back(plant.step(force) + draw(random));
      cut.record.air[axis].push_back(draw(random));
    }
  }
  return cut;
}

/// RMS over the three axes, whose noise is drawn independently.
double rmsOf(const std::array<double, 3>& errors) {
  double squares = 0.0;
  for (const double error : errors) squares += error * error / 3.0;
  return std::sqrt(squares);
}

double trueError(const Cut& cut, std::size_t axis, std::optional<double> memory) {
  HarmonicFilterParameters parameters;
  if (memory) {
    parameters.uniform_noise = true;
    parameters.memory_revolutions = *memory;
  }
  HarmonicFilter filter(cut.sensor[0].model, cut.record.speed, RATE, parameters);
  double squares = 0.0;
  for (std::size_t i = 0; i < cut.truth.size(); ++i)
    squares += std::pow(filter.step(cut.record.cut[axis][i]) - cut.truth[i], 2);
  return std::sqrt(squares / static_cast<double>(cut.truth.size()));
}

// The truth is not given to the tuner: its choice and its expected error are compared with it.
TEST(MemoryTuner, FindsTheLeastErrorAndStatesIt) {
  const Cut cut = cutWithNoise(5.0, 0.0);
  const std::array<TunedMemory, 3> tuned = tuneMemory(cut.record, cut.sensor, {});
  std::array<double, 3> expected{}, actual{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    ASSERT_TRUE(tuned[axis].memory);
    const double fixed = trueError(cut, axis, std::nullopt), is = trueError(cut, axis, tuned[axis].memory);
    EXPECT_LT(is, 0.9 * fixed);
    double best = fixed;
    for (const double memory : TuningOptions().memories) best = std::min(best, trueError(cut, axis, memory));
    EXPECT_LT(is, 1.15 * best);  // the neighbours of the optimum are as close
    expected[axis] = tuned[axis].error;
    actual[axis] = is;
  }
  // The noise of the smoothed force counts as force at tool entry: up to a third more.
  EXPECT_GT(rmsOf(expected) / rmsOf(actual), 0.7);
  EXPECT_LT(rmsOf(expected) / rmsOf(actual), 1.4);
}

// A strong line between two harmonics, as chatter: no harmonic explains it, and no error can be predicted.
TEST(MemoryTuner, KeepsTheFixedDesignWhereInnovationsAreNotWhite) {
  const Cut cut = cutWithNoise(0.1, 30.0);
  EXPECT_FALSE(tuneMemory(cut.record, cut.sensor, {})[0].memory);
}

TEST(MemoryTuner, RefusesARecordWithoutAir) {
  Cut cut = cutWithNoise(1.0, 0.0);
  cut.record.air[1].clear();
  EXPECT_THROW(tuneMemory(cut.record, cut.sensor, {}), Error);
}

/// Blocks of 10 ms, 256 samples: the spindle runs up in the first five and stops in the last five; the tool
/// enters after 20 blocks at speed. @param gap block after which samples are missing; -1: none
void feed(TuningRecords& records, CuttingCondition::Kind kind, double speed, int blocks, std::uint64_t& index,
          int gap = -1) {
  CuttingCondition condition;
  condition.kind = kind;
  records.handle(condition);
  for (int b = -5; b < blocks + 5; ++b) {
    SpindleAngle angle;
    angle.speed = b < 0 ? speed * (b + 6) / 6.0 : b < blocks ? speed : speed * (blocks + 5 - b) / 6.0;
    records.handle(angle);
    SampleBlock block;
    block.sample_rate = RATE;
    block.first_index = index;
    block.channels = {"fx", "fy", "fz"};
    block.units.assign(3, "N");
    const double size = kind == CuttingCondition::Kind::cut && b >= 20 ? 50.0 : 1.0;
    for (int i = 0; i < 3 * 256; ++i) block.samples.push_back(i / 3 % 2 == 0 ? size : -size);
    records.handle(block);
    index += 256 + (b == gap ? 10 : 0);
  }
}

TEST(TuningRecords, PairsAirWithTheCutAtTheSameSpeed) {
  using Kind = CuttingCondition::Kind;
  TuningRecords records;
  std::uint64_t index = 0;
  feed(records, Kind::air, 300.0, 50, index);
  feed(records, Kind::none, 300.0, 1, index);  // between two programs
  feed(records, Kind::cut, 300.0, 300, index);
  feed(records, Kind::air, 200.0, 50, index);
  feed(records, Kind::cut, 200.0, 50, index);
  feed(records, Kind::air, 400.0, 50, index);
  feed(records, Kind::cut, 500.0, 50, index);  // no air at this speed
  feed(records, Kind::air, 600.0, 50, index);
  feed(records, Kind::cut, 600.0, 50, index, 22);  // the entry is not in one record
  feed(records, Kind::air, 700.0, 50, index);
  feed(records, Kind::cut, 700.0, 60, index, 55);  // samples are missing after the record is long enough
  feed(records, Kind::none, 0.0, 1, index);
  const std::vector<TuningRecord> found = records.records();
  ASSERT_EQ(found.size(), 3u);
  EXPECT_EQ(found[0].speed, 200.0);
  EXPECT_EQ(found[0].cut[0].size(), 50u * 256u);
  EXPECT_EQ(found[1].speed, 300.0);
  EXPECT_EQ(found[1].cut[2].size(), 51200u);  // two seconds
  EXPECT_EQ(found[1].air[2].size(), 50u * 256u);
  EXPECT_EQ(found[2].cut[0].size(), 56u * 256u);
}

}  // namespace
}  // namespace smartmill::kalman
