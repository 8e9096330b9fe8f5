#include "smartmill_stability/chart/pitch_design.h"

#include <cmath>
#include <numeric>

#include <gtest/gtest.h>

#include "smartmill_stability_testing/oracles.h"

namespace smartmill::stability {
namespace {

using units::PI;
using units::TWO_PI;

/// Slow enough for many waves in a tooth period: the lobes lie close together.
RegenerativeSystem slowSystem(int teeth) {
  RegenerativeSystem system = benchmarkSystem(0.5, true, false);
  system.teeth = teeth;
  return system;
}

TEST(PitchDesign, LinearPitchesAddUpToARevolution) {
  const std::vector<double> pitch = linearPitch(5, 0.02);
  EXPECT_NEAR(std::accumulate(pitch.begin(), pitch.end(), 0.0), TWO_PI, 1e-12);
  EXPECT_NEAR(pitch[3] - pitch[2], 0.02, 1e-12);
}

// Budak 2003: dP = pi speed / w for an even number of teeth, (N +- 1) / N of it for an odd one, and odd
// multiples (even number) of it, w the chatter frequency.
TEST(PitchDesign, IsBudaksVariation) {
  for (const int teeth : {2, 3, 4}) {
    const RegenerativeSystem system = slowSystem(teeth);
    const double speed = units::radPerSecFromRpm(3000.0);
    const PitchDesign design = designPitch(system, speed, 30e-3);
    ASSERT_TRUE(std::isfinite(design.limit.depth)) << teeth;
    EXPECT_GT(design.least_limit, 1.5 * design.even_limit) << teeth;
    // Sum over the teeth of exp(-i w P / speed), which is the delayed part of the feedback, relative to even
    // pitch.
    const double w = TWO_PI * design.limit.frequency;
    std::complex<double> sum = 0.0;
    for (const double pitch : design.pitch) sum += std::polar(1.0 / teeth, -w * pitch / speed);
    EXPECT_LT(std::abs(sum), 0.35) << teeth;
    // The closed form itself, at the natural frequency, gives no larger limit than the search within its
    // steps.
    const double share = teeth % 2 == 0 ? 1.0 : (teeth + 1.0) / teeth;
    RegenerativeSystem budak = system;
    budak.pitch = linearPitch(teeth, share * PI * speed / (TWO_PI * 922.0));
    const auto solver = makeSolver(Method::collocation, budak);
    double least = 1.0;
    for (const double side : {0.98, 1.0, 1.02})
      least = std::min(least, solver->limit(side * speed, 30e-3).depth);
    EXPECT_GT(design.least_limit, 0.97 * least) << teeth;
    EXPECT_GT(least, 1.5 * design.even_limit) << teeth;
  }
}

TEST(PitchDesign, RefusesOneTooth) {
  EXPECT_THROW(designPitch(slowSystem(1), 300.0, 5e-3), std::exception);
  EXPECT_THROW(designPitch(slowSystem(2), 0.0, 5e-3), std::exception);
}

}  // namespace
}  // namespace smartmill::stability
