#include "stability/turning_loop.h"

#include <cmath>
#include <complex>
#include <limits>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

// Without control: growth by the dominant root of the linear process, until the tool leaves the cut.
TEST(TurningLoop, theFreeLatheGrowsAsItsRootAndThenLeavesTheCut) {
  TurningLoop loop = kimLoop(1.0);
  loop.controlled = false;
  const TurningTrace trace = runTurning(loop);
  EXPECT_NEAR(std::log(trace.vibration(3.0, 4.0) / trace.vibration(0.952, 1.952)), 1.0, 0.05);
  loop = kimLoop(3.0);
  loop.controlled = false;
  const TurningTrace full = runTurning(loop);
  EXPECT_NEAR(full.vibration(5.6, 6.1) / full.vibration(4.6, 5.1), 1.0, 0.02);
  double least = 1.0;
  for (const double f : full.force) least = std::min(least, f);
  EXPECT_EQ(least, 0.0);
}

// With delayed blocks, a servo with finite bandwidth and a nonlinear chip force.
TEST(TurningLoop, chatterEndsOverATopicsDelay) {
  for (const double exponent : {1.0, 0.7}) {
    TurningLoop loop = kimLoop(2.0);
    loop.block = 100, loop.way = 4;
    loop.control.controller.lead = 0.05;
    loop.lathe.chip_exponent = exponent;
    loop.duration = 4.0;
    const TurningTrace trace = runTurning(loop);
    EXPECT_EQ(trace.late, 0u);
    EXPECT_NEAR(trace.learnt.front().machine.frequency, 350.0, 1.0);
    EXPECT_NEAR(trace.learnt.front().machine.damping_ratio, 0.02, 0.002);
    EXPECT_GT(trace.vibration(1.0, 2.0), 8e-6);
    EXPECT_LT(trace.vibration(3.5, 4.0), 0.05e-6) << exponent;
  }
}

TEST(TurningLoop, anAccelerometerWillDo) {
  TurningLoop loop = kimLoop(2.0);
  loop.control.deflection_channel = "headstock";
  loop.duration = 4.0;
  EXPECT_LT(runTurning(loop).vibration(3.5, 4.0), 0.1e-6);
}

TEST(TurningLoop, aCommandThatIsLateIsCounted) {
  TurningLoop loop = kimLoop(2.0);
  loop.control.controller.lead = 0.0;
  loop.duration = 2.2;
  EXPECT_GT(runTurning(loop).late, 0u);
}

// Eq. 16 on exact spectra: machine G, no control in the first segment, G_1 in force in the second. The secant
// of Y_w - Y_t ends at G in one step from any G_1. As printed, with both estimates, G itself being the
// second, the result is G^2 / G_1: the error of the first estimate returns inverted.
TEST(KimUpdate, theSecantFindsTheMachineAndThePrintedFormInvertsTheFirstError) {
  using Complex = std::complex<double>;
  const Complex g(0.3, -1.2), force(2.0, 0.7);
  for (const Complex first : {Complex(0.2, -1.0), Complex(0.5, -1.5), Complex(0.3, -0.6)}) {
    EXPECT_LT(std::abs(updateLine(KimUpdate::corrected, {g, first, first}, {0.0, 0.0, 0.0}) - g), 1e-12);
    const Complex printed = updateLine(KimUpdate::printed, {g * force, first * force, g}, {0.0, 0.0, first});
    EXPECT_LT(std::abs(printed - g * g / first), 1e-12);
    EXPECT_GT(std::abs(printed - g), 0.5 * std::abs(first - g));
  }
  EXPECT_EQ(updateLine(KimUpdate::printed, {1.0, 0.5, g}, {0.0, 0.5, 2.0 * g}), g);
}

// The first estimate precedes eq. 16, so that it and the second segment are the same by both forms.
TEST(KimUpdate, bothFormsBeginAlike) {
  TurningLoop loop = kimLoop(1.0);
  loop.lathe.servo_frequency = 0.45 * loop.lathe.rate;
  loop.duration = 4.2;
  const KimRun printed = runKim(loop, KimUpdate::printed), corrected = runKim(loop, KimUpdate::corrected);
  ASSERT_EQ(printed.segments.size(), 2u);
  ASSERT_EQ(corrected.segments.size(), 2u);
  EXPECT_EQ(printed.segments[0].read.frequency, corrected.segments[0].read.frequency);
  EXPECT_EQ(printed.trace.vibration(3.0, 4.0), corrected.trace.vibration(3.0, 4.0));
  EXPECT_NE(printed.segments[1].read.damping_ratio, corrected.segments[1].read.damping_ratio);
}

TEST(Lathe, refusesWhatIsWrong) {
  const auto error = [](auto&& act) {
    try {
      act();
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  sim::LatheTraits traits;
  traits.stiffness = {2e7, 3e7};
  EXPECT_EQ(error([&] { sim::Lathe lathe(traits); }),
            "frequency, damping_ratio, stiffness: 1, 1, 2 values, expected one of each per mode");
  sim::Lathe lathe({});
  SampleBlock commands;
  commands.sample_rate = 1e4;
  commands.channels = {"command"};
  commands.units = {"V"};
  commands.samples = {1e-6};
  EXPECT_EQ(error([&] { lathe.command(commands); }), "command: the unit is V, expected m");
  commands.units = {"m"};
  commands.samples = {std::nan("")};
  EXPECT_EQ(error([&] { lathe.command(commands); }), "command: a value is not finite");
}

}  // namespace
}  // namespace smartmill::stability
