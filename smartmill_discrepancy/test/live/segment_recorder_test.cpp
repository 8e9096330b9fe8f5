#include "smartmill_discrepancy/live/segment_recorder.h"

#include <array>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

constexpr double RATE = 25600.0, SPEED = 600.0, PHASE = 1.0, FEED = 0.01;
constexpr std::size_t BLOCK = 256;

struct Machine {
  double feed_offset = 0.0;      // [m] across the path
  double lost_at = -1.0;         // [s] time of a lost block
  double started_cutting = 0.0;  // [s]
  double actual_speed = SPEED;   // [rad/s]
  double begin = 100.0;          // [s] stamp of the start
  double settle = 0.0;           // [s]
  ComparedForce compared = ComparedForce::measured;
  double settling_at = -1.0;                   // [s] time of a block in which the compensation settles
  double stops = 1e300;                        // [s] the controller's position leaves the path from here on
  double acceleration = 0.0;                   // [rad/s2] of the spindle
  std::array<double, 3> way{{1.0, 0.0, 0.0}};  // direction of the feed
  double cut_time_before = NOT_A_NUMBER;       // [s]
};

/// A second of straight cutting through the recorder; fx counts samples.
std::vector<RecordSegment> run(const Machine& machine, double length = 0.3) {
  std::vector<RecordSegment> segments;
  SegmentParameters parameters;
  parameters.length = length;
  parameters.settle = machine.settle;
  SegmentPipeline recorder(parameters, machine.compared, 0.05,
                           [&](const RecordSegment& s) { segments.push_back(s); });
  CuttingCondition condition;
  condition.stamp = machine.begin;
  condition.kind = CuttingCondition::Kind::cut;
  condition.name = "slot";
  condition.tool.teeth = 4;
  condition.spindle_speed = SPEED;
  condition.cut_time_before = machine.cut_time_before;
  condition.engagement.feed_per_tooth = 1e-4;
  condition.engagement.axial_depth = 1e-3;
  for (std::size_t a = 0; a < 3; ++a) condition.steady_to[a] = 0.1 * machine.way[a];
  recorder.push(condition);
  for (int k = 0; k < 100; ++k) {  // 10 ms each
    const double t = 0.01 * k, stamp = machine.begin + t;
    if (k % 2 == 0) {
      CncState state;
      state.stamp = stamp;
      state.axes = {"X", "Y", "Z"};
      const double along = FEED * (t - machine.started_cutting);
      state.position = {along * machine.way[0], along * machine.way[1] + machine.feed_offset,
                        along * machine.way[2]};
      if (t > machine.stops) state.position[2] = 0.01;
      state.spindle_speed = machine.actual_speed;
      recorder.push(state);
    }
    SpindleAngle angle;
    angle.stamp = stamp;
    angle.speed = machine.actual_speed;
    angle.angle =
        std::fmod(PHASE + machine.actual_speed * t + 0.5 * machine.acceleration * t * t, units::TWO_PI);
    recorder.push(angle);
    LoadSample load;
    load.stamp = stamp + 0.004;
    load.spindle_load = t;
    recorder.push(load);
    if (std::abs(t - machine.lost_at) < 1e-6) continue;
    SampleBlock block;
    block.stamp = stamp;
    block.sample_rate = RATE;
    block.first_index = static_cast<std::uint64_t>(k) * BLOCK;
    block.channels = {"fx", "fy", "fz"};
    block.units = {"N", "N", "N"};
    for (std::size_t i = 0; i < BLOCK; ++i) {
      const double index = static_cast<double>(static_cast<std::size_t>(k) * BLOCK + i);
      block.samples.insert(block.samples.end(), {index, -index, 0.5});
    }
    if (machine.compared == ComparedForce::measured) {
      recorder.push(block);
      continue;
    }
    ForceBlock compensated;
    compensated.stamp = block.stamp;
    compensated.sample_rate = RATE;
    compensated.first_index = block.first_index;
    for (std::size_t i = 0; i < BLOCK; ++i) {
      for (std::size_t axis = 0; axis < 3; ++axis) compensated.force[axis].push_back(block.at(i, axis));
    }
    compensated.status = std::abs(t - machine.settling_at) < 1e-6 ? ForceBlock::Status::settling
                                                                  : ForceBlock::Status::compensated;
    recorder.push(compensated);
  }
  recorder.flush();
  return segments;
}

TEST(SegmentRecorder, CutsSteadyCuttingIntoEqualSegments) {
  const std::vector<RecordSegment> segments = run(Machine());
  ASSERT_EQ(segments.size(), 3U);  // 0.3 s of a second
  for (std::size_t k = 0; k < 3; ++k) {
    const RecordSegment& s = segments[k];
    EXPECT_NEAR(s.stamp, 100.3 + 0.3 * static_cast<double>(k), 1e-6);
    EXPECT_EQ(s.test.kind, TestKind::cut);
    EXPECT_NEAR(s.test.spindle_speed, SPEED, 1e-6);
    ASSERT_EQ(s.record.size(), 7680U);
    const auto& fx = s.record.column("fx");
    const auto& angle = s.record.column("spindle_angle");
    for (std::size_t i = 0; i < fx.size(); ++i) {
      ASSERT_EQ(fx[i], static_cast<double>(7680 * k + i));
      // The angle of the machine at that sample.
      ASSERT_NEAR(std::remainder(angle[i] - PHASE - SPEED * fx[i] / RATE, units::TWO_PI), 0.0, 1e-6);
    }
  }
}

TEST(SegmentRecorder, StatesTheDirectionOfTheFeedAndLeavesOutRamps) {
  Machine machine;
  machine.way = {-0.6, 0.8, 0.0};
  const std::vector<RecordSegment> segments = run(machine);
  ASSERT_EQ(segments.size(), 3U);
  EXPECT_NEAR(segments[0].test.feed_direction, std::atan2(0.8, -0.6), 1e-9);
  machine.way = {0.8, 0.0, -0.6};
  EXPECT_TRUE(run(machine).empty());
}

// running_before and cut_time_before of the segments, needed by the twin.
TEST(SegmentRecorder, StatesTheTimeBefore) {
  Machine machine;
  machine.settle = 0.2;
  machine.started_cutting = 0.1;
  const std::vector<RecordSegment> segments = run(machine);
  ASSERT_EQ(segments.size(), 2U);  // 0.3..0.6, 0.6..0.9
  for (std::size_t k = 0; k < 2; ++k) {
    const CampaignTest& test = segments[k].test;
    const double begin = 0.3 + 0.3 * static_cast<double>(k);
    EXPECT_FALSE(test.engage_time);
    EXPECT_NEAR(*test.running_before, begin - 0.1, 1e-6);
    EXPECT_NEAR(*test.cut_time_before, begin - 0.1, 1e-6);
    EXPECT_NEAR(*test.start_time, begin, 1e-6);
    const std::vector<LoadMeasurement>& load = segments[k].load;
    ASSERT_GE(load.size(), 28U);
    for (const LoadMeasurement& r : load) EXPECT_NEAR(r.load, begin + r.time - 0.004, 1e-6);
  }
}

TEST(SegmentRecorder, CountsTheTimeInTheWorkFromThatOfTheCondition) {
  Machine machine;
  machine.cut_time_before = 40.0;
  const std::vector<RecordSegment> segments = run(machine);
  ASSERT_EQ(segments.size(), 3U);
  for (std::size_t k = 0; k < 3; ++k)
    EXPECT_NEAR(*segments[k].test.cut_time_before, 40.0 + 0.3 * static_cast<double>(k), 1e-6);
}

// The controller's state may be late: samples of an ended cut can precede it.
TEST(SegmentRecorder, WaitsForTheControllersConfirmation) {
  Machine machine;
  machine.stops = 0.61;
  EXPECT_EQ(run(machine).size(), 1U);  // not 0.3..0.6
}

TEST(SegmentRecorder, OmitsAnAcceleratingSpindle) {
  Machine machine;
  machine.acceleration = 10.0;  // 0.1 rad between middle and ends of a segment
  EXPECT_TRUE(run(machine).empty());
}

TEST(SegmentRecorder, OmitsUnsteadyMotion) {
  Machine off_path;
  off_path.feed_offset = 2e-4;
  EXPECT_TRUE(run(off_path).empty());
  Machine slow;
  slow.actual_speed = 0.95 * SPEED;
  EXPECT_TRUE(run(slow).empty());
  Machine late;  // steady after 0.5 s: one segment
  late.started_cutting = 0.5;
  const std::vector<RecordSegment> one = run(late);
  ASSERT_EQ(one.size(), 1U);
  EXPECT_GE(one[0].record.column("fx").front(), 0.5 * RATE);
}

TEST(SegmentRecorder, NeverSpansLostSamples) {
  Machine losing;
  losing.lost_at = 0.2;
  const std::vector<RecordSegment> segments = run(losing);
  ASSERT_EQ(segments.size(), 2U);  // 0.21..0.51, 0.51..0.81
  EXPECT_EQ(segments[0].record.column("fx").front(), 21.0 * 256.0);
  for (const RecordSegment& s : segments) {
    const auto& fx = s.record.column("fx");
    EXPECT_EQ(fx.back() - fx.front(), static_cast<double>(fx.size() - 1));
  }
}

TEST(SegmentRecorder, TakesCompensatedForcesWhileTheyAreCompensated) {
  Machine machine;
  machine.compared = ComparedForce::compensated;
  machine.settling_at = 0.2;
  const std::vector<RecordSegment> segments = run(machine);
  ASSERT_EQ(segments.size(), 2U);  // as with a lost block
  EXPECT_EQ(segments[0].record.column("fx").front(), 21.0 * 256.0);
  EXPECT_EQ(segments[0].record.column("fy").front(), -21.0 * 256.0);
}

}  // namespace
}  // namespace smartmill::discrepancy
