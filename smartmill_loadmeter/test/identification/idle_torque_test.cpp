// Torque of a cut with air cuts at one speed: by hand from the voltages.
#include "smartmill_loadmeter/identification/idle_torque.h"

#include <cmath>

#include <gtest/gtest.h>

namespace smartmill::loadmeter {
namespace {

constexpr double GAIN = 4e-4;  // [V/W]

LoadTest testAt(double speed, double torque, double voltage_std) {
  LoadTest test;
  test.condition.kind = CuttingCondition::Kind::air;
  test.speed = speed;
  test.voltage = {GAIN * speed * torque, voltage_std};
  return test;
}

Spindle spindle() {
  Spindle s;
  s.load_meter_gain = GAIN;
  s.viscous = 4e-4;
  return s;
}

TEST(CuttingTorque, AirCutsAtOneSpeedCountForCutsAtThisSpeed) {
  const std::vector<LoadTest> air{testAt(400.0, 0.3, 1e-3), testAt(400.0, 0.5, 1e-3)};
  const auto torque = cuttingTorque(testAt(400.0, 2.0, 2e-3), air, spindle(), 10.0);
  ASSERT_TRUE(torque);
  EXPECT_NEAR(torque->value, 2.0 - 0.4, 1e-12);
  // 1 mV at 400 rad/s are 6.25 mN m; rounding is common to both air cuts.
  EXPECT_NEAR(torque->std_dev, std::hypot(0.0125, 0.00625), 1e-9);
  EXPECT_FALSE(cuttingTorque(testAt(500.0, 2.0, 2e-3), air, spindle(), 10.0));
}

}  // namespace
}  // namespace smartmill::loadmeter
