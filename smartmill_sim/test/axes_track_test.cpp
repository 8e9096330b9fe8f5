#include <gtest/gtest.h>

#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/world/axes_track.h"

namespace smartmill::sim {
namespace {

/// Samples at 1 kHz: x moves at 20 mm/s, the spindle at 100 revolutions per second, from given initial
/// values.
SampleBlock block(double stamp, std::size_t count, double x = 0.0, double revolutions = 0.0) {
  SampleBlock b;
  b.stamp = stamp;
  b.sample_rate = 1000.0;
  b.channels = {"x", "y", "z", "revolutions"};
  b.units = {"m", "m", "m", "1"};
  for (std::size_t i = 0; i < count; ++i) {
    const double t = 1e-3 * static_cast<double>(i);
    b.samples.insert(b.samples.end(), {x + 0.02 * t, -0.1, -0.2, revolutions + 100.0 * t});
  }
  return b;
}

TEST(AxesTrack, InterpolatesLinearlyBetweenSamples) {
  AxesTrack track;
  track.push(block(10.0, 11));
  const MotionState state = track.at(10.0 + 3.3e-3);
  EXPECT_NEAR(state.position[0], 0.02 * 3.3e-3, 1e-12);
  EXPECT_NEAR(state.velocity[0], 0.02, 1e-9);
  EXPECT_DOUBLE_EQ(state.position[2], -0.2);
  EXPECT_NEAR(state.spindle_angle, units::TWO_PI * 0.33, 1e-9);
  EXPECT_NEAR(state.spindle_speed, units::TWO_PI * 100.0, 1e-5);
  EXPECT_NEAR(*track.newest(), 10.010, 1e-12);
}

TEST(AxesTrack, MovesAtTheTimeOfASampleAsWell) {
  AxesTrack track;
  track.push(block(10.0, 11));
  for (const int k : {0, 3, 9}) {
    const SampleBlock b = block(10.0, 11);
    const MotionState state = track.at(b.timeOf(static_cast<std::size_t>(k)));
    EXPECT_NEAR(state.spindle_speed, units::TWO_PI * 100.0, 1e-5) << k;
    EXPECT_NEAR(state.velocity[0], 0.02, 1e-9) << k;
  }
}

TEST(AxesTrack, TakesTheToolWhereItIsStated) {
  AxesTrack track;
  track.push(block(10.0, 2));
  SampleBlock with_tool;
  with_tool.stamp = 10.002;
  with_tool.sample_rate = 1000.0;
  with_tool.channels = {"x", "y", "z", "revolutions", "tool"};
  with_tool.samples = {0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 2.0};
  track.push(with_tool);
  EXPECT_EQ(track.at(10.0005).tool, 0);
  EXPECT_EQ(track.at(10.0025).tool, 2);
}

TEST(AxesTrack, SamplesThatAreNotNewerAreIgnored) {
  AxesTrack track;
  track.push(block(10.0, 11));
  track.push(block(10.005, 11, 7.0));
  EXPECT_NEAR(track.at(10.0095).position[0], 0.02 * 9.5e-3, 1e-12);
  EXPECT_NEAR(*track.newest(), 10.015, 1e-9);
}

TEST(AxesTrack, IsAtRestOverAGapAndResumesAtTheNextSample) {
  AxesTrack track;
  track.push(block(10.0, 11));
  track.push(block(11.0, 11, 0.1));
  EXPECT_EQ(track.at(10.5).position[0], 0.02 * 10e-3);
  EXPECT_EQ(track.at(10.5).velocity[0], 0.0);
  EXPECT_EQ(track.at(10.5).spindle_speed, 0.0);
  EXPECT_NEAR(track.at(11.0005).position[0], 0.1 + 0.02 * 5e-4, 1e-12);
}

TEST(AxesTrack, AxesOfASilentControllerAreAtRest) {
  AxesTrack track;
  EXPECT_EQ(track.at(3.0).position[0], 0.0);
  track.push(block(10.0, 11));
  track.holdUntil(10.2);
  EXPECT_EQ(*track.newest(), 10.2);
  EXPECT_EQ(track.at(10.1).velocity[0], 0.0);
  // The motion restarts at another position: nothing is interpolated to it.
  track.push(block(10.2005, 5, 0.3));
  const MotionState between = track.at(10.2003);
  EXPECT_EQ(between.velocity[0], 0.0);
  EXPECT_EQ(between.position[0], 0.02 * 10e-3);
  EXPECT_NEAR(track.at(10.201).position[0], 0.3 + 0.02 * 5e-4, 1e-9);
}

TEST(AxesTrack, AMissingChannelIsNamed) {
  SampleBlock b = block(0.0, 1);
  b.channels[3] = "angle";
  AxesTrack track;
  try {
    track.push(b);
    FAIL();
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find("revolutions"), std::string::npos) << e.what();
  }
}

}  // namespace
}  // namespace smartmill::sim
