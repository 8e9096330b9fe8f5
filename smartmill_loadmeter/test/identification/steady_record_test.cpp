// Mean velocity along the steady path of a test from the controller's states.
#include "smartmill_loadmeter/identification/steady_record.h"

#include <cmath>

#include <gtest/gtest.h>

namespace smartmill::loadmeter {
namespace {

constexpr double FEED = 0.02;    // [m/s]
constexpr double PERIOD = 0.02;  // [s] of the states

CncState stateAt(double stamp, double x) {
  CncState state;
  state.stamp = stamp;
  state.connected = state.motion = true;
  state.axes = {"X", "Y", "Z"};
  state.position = {x, 0.0, 0.0};
  return state;
}

CuttingCondition slot() {
  CuttingCondition condition;
  condition.kind = CuttingCondition::Kind::cut;
  condition.spindle_speed = 300.0;
  condition.steady_from = {0.0, 0.0, 0.0};
  condition.steady_to = {0.02, 0.0, 0.0};
  return condition;
}

SteadyRecord record() {
  Spindle spindle;
  spindle.load_meter_bandwidth = 50.0;
  spindle.load_meter_full_scale = 8.0;
  return {spindle, IdentificationParameters()};
}

TEST(SteadyRecord, VelocityIsPathByTime) {
  SteadyRecord steady = record();
  steady.begin(slot());
  EXPECT_EQ(steady.velocity()[0], 0.0);
  for (int i = 0; i <= 40; ++i) {
    steady.handle(stateAt(i * PERIOD, FEED * i * PERIOD));
    if (i == 0) {
      EXPECT_EQ(steady.velocity()[0], 0.0);
    }
  }
  EXPECT_NEAR(steady.velocity()[0], FEED, 1e-9);
  EXPECT_EQ(steady.velocity()[1], 0.0);
}

// A state that a busy computer receives 0.1 s late is stamped late: path by time of the first and the last
// point alone would be 11 % too slow.
TEST(SteadyRecord, AStateStampedLateHardlyChangesTheVelocity) {
  SteadyRecord steady = record();
  steady.begin(slot());
  for (int i = 0; i <= 40; ++i) steady.handle(stateAt(i * PERIOD + (i == 40 ? 0.1 : 0.0), FEED * i * PERIOD));
  EXPECT_NEAR(steady.velocity()[0], FEED, 0.025 * FEED);
}

// Along an arc the cut has no line: the load is that of the whole condition, a mean force does not exist.
TEST(SteadyRecord, WhereTheFeedTurnsTheLoadIsReadAndNoForce) {
  SteadyRecord steady = record();
  CuttingCondition arc = slot();
  arc.steady_to = {NOT_A_NUMBER, NOT_A_NUMBER, NOT_A_NUMBER};
  steady.begin(arc);
  int read = 0;
  for (int i = 0; i <= 100; ++i) {
    const double stamp = i * PERIOD;
    CncState state = stateAt(stamp, 0.01 * std::cos(2.0 * stamp));
    state.feed = i < 50 ? FEED : 0.0;  // then a feed hold
    steady.handle(state);
    LoadSample load;
    load.stamp = stamp;
    load.spindle_load = 0.1;
    load.spindle_speed = 300.0;
    const SteadyRecord::Reading reading = steady.handle(load);
    if (i >= 50) {
      EXPECT_EQ(reading, SteadyRecord::Reading::ignored);
    }
    read += reading == SteadyRecord::Reading::steady;
    ForceBlock force;
    force.stamp = stamp;
    force.sample_rate = 1000.0;
    for (auto& axis : force.force) axis = {1.0};
    steady.handle(force);
  }
  EXPECT_GT(read, 30);
  steady.end();
  EXPECT_FALSE(steady.test().sensor);
  EXPECT_EQ(steady.velocity()[0], 0.0);
}

}  // namespace
}  // namespace smartmill::loadmeter
