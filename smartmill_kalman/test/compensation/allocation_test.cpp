#include <cmath>
#include <cstdlib>
#include <new>

#include <gtest/gtest.h>

#include "smartmill_core/units.h"
#include "smartmill_kalman/compensation/compensation_pipeline.h"
#include "smartmill_kalman_testing/reference_case.h"

namespace {

long allocations = 0;

}  // namespace

// Counts the allocations of the whole program. The compiler inlines these and then takes malloc and delete
// for a mismatch.
#pragma GCC diagnostic ignored "-Wmismatched-new-delete"
void* operator new(std::size_t size) {
  void* place = std::malloc(size > 0 ? size : 1);
  if (!place) throw std::bad_alloc();
  ++allocations;
  return place;
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  ++allocations;
  return std::malloc(size > 0 ? size : 1);
}
void operator delete(void* place) noexcept {
  std::free(place);
}
void operator delete(void* place, std::size_t) noexcept {
  std::free(place);
}

namespace smartmill::kalman {
namespace {

constexpr double RATE = 25600.0, SPEED = units::TWO_PI * 150.0;

TEST(Allocation, NoneASample) {
  HarmonicFilter filter(ReferenceCase::exactSensor(), SPEED, RATE, {});
  const long before = allocations;
  double sum = 0.0;
  for (int i = 0; i < 50000; ++i) sum += filter.step(100.0 * std::cos(4.0 * SPEED * i / RATE));
  EXPECT_EQ(allocations, before);
  EXPECT_TRUE(std::isfinite(sum));
}

/// Allocations of one block once all filters are designed.
long aBlock(bool coupled, bool spindle, std::size_t samples) {
  ForceSensor model_sensor;
  for (ModalModel& axis : model_sensor.axis) axis = ReferenceCase::exactSensor();
  CompensationPipeline pipeline({}, {}, model_sensor, 0.0, {});
  if (coupled) {
    SensorMatrix matrix;
    for (std::size_t i = 0; i < 3; ++i) {
      matrix.h[i][i] = model_sensor.axis[i];
      matrix.h[i][(i + 1) % 3].direct = 0.05;
    }
    pipeline.forces().useMatrix(matrix);
  }
  if (spindle) pipeline.useSpindleSensor(SpindleSensorCalibration::table3(), 0.139);
  SampleBlock block;
  block.sample_rate = RATE;
  block.channels = spindle ? std::vector<std::string>{"x1", "x2", "y1", "y2", "z1", "z2"}
                           : std::vector<std::string>{"fx", "fy", "fz"};
  block.units.assign(block.channels.size(), "N");
  block.samples.assign(block.channels.size() * samples, 1.0);
  const int blocks = 64;
  long before = 0;
  for (int b = 0; b < 2 * blocks; ++b) {
    if (b == blocks) before = allocations;
    pipeline.push(SpindleAngle{block.stamp, 0.0, SPEED});
    pipeline.push(block);
    block.first_index += samples;
    block.stamp += static_cast<double>(samples) / RATE;
  }
  return (allocations - before) / blocks;
}

// A block costs its vectors; ten times the samples do not cost more.
TEST(Allocation, ABlockDoesNotDependOnItsLength) {
  for (const bool coupled : {false, true}) {
    for (const bool spindle : {false, true}) {
      const long shorter = aBlock(coupled, spindle, 64), longer = aBlock(coupled, spindle, 640);
      EXPECT_EQ(shorter, longer) << coupled << spindle;
      EXPECT_LT(longer, 64) << coupled << spindle;
    }
  }
}

}  // namespace
}  // namespace smartmill::kalman
