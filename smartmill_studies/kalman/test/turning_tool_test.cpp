#include "kalman/turning_tool.h"

#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

// The direct FRF of the two coupled equations of motion, inverted line by line.
TEST(TurningSpindle, IsTheDirectFrfOfARotor) {
  sim::TurningSpindle spindle;
  spindle.reference_speed = 1000.0;
  spindle.gyroscopic = 0.06;
  ModalModel standing;
  standing.modes = {{1000.0, 0.02, 1.0 / 20e6}};
  const ModalModel turning = spindle.at(1500.0, standing);
  ASSERT_EQ(turning.modes.size(), 2U);
  EXPECT_NEAR(turning.staticGain(), standing.staticGain(), 1e-12 * standing.staticGain());
  const double w0 = units::TWO_PI * 1000.0, k = 20e6, m = k / (w0 * w0), c = 2.0 * 0.02 * w0 * m,
               g = 2.0 * m * 0.06 * 1.5 * w0;
  for (double f = 700.0; f < 1400.0; f += 10.0) {
    const double w = units::TWO_PI * f;
    const std::complex<double> d(k - m * w * w, c * w), cross(0.0, g * w);
    const std::complex<double> direct = d / (d * d + cross * cross);
    // To first order in the damping.
    EXPECT_LT(std::abs(turning.response(f) - direct), 0.02 / k) << f;
  }
}

// Cuts at three speeds identify the softened tool, which differs from the tap at rest.
TEST(TurningTool, CutsTellTheModesOfTheTurningSpindle) {
  TurningToolCase c = turningToolCase();
  c.speeds = {c.speeds[2], c.speeds[3], c.speeds[4]};
  const std::array<std::vector<SpeedFrf>, 2> found = c.identify(5);
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const ModalModel& standing = axis == 0 ? c.model.tool_tip.x : c.model.tool_tip.y;
    for (std::size_t g = 0; g < c.speeds.size(); ++g) {
      const Mode truth = c.spindle.at(c.speeds[g], standing).modes.front();
      ASSERT_TRUE(found[axis][g].fit) << found[axis][g].reason;
      ASSERT_EQ(found[axis][g].fit->model.modes.size(), 1U);
      const Mode& mode = found[axis][g].fit->model.modes.front();
      EXPECT_NEAR(mode.frequency, truth.frequency, 0.003 * truth.frequency);
      EXPECT_NEAR(mode.frequency, truth.frequency, 4.0 * mode.frequency_std);
      EXPECT_NEAR(mode.damping_ratio, truth.damping_ratio, 0.05 * truth.damping_ratio);
      EXPECT_NEAR(mode.gain, truth.gain, 0.02 * truth.gain);
    }
    // The difference from rest is 50 Hz at the highest speed.
    EXPECT_LT(found[axis][2].fit->model.modes[0].frequency, standing.modes[0].frequency - 40.0);
  }
}

}  // namespace
}  // namespace smartmill::kalman
