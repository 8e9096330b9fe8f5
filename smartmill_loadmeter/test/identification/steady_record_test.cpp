// Mean velocity along the steady path of a test from the controller's states.
#include "smartmill_loadmeter/identification/steady_record.h"

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

}  // namespace
}  // namespace smartmill::loadmeter
