#include "smartmill_stability_testing/time_domain.h"

#include <cstdlib>
#include <iostream>

#include <gtest/gtest.h>

#include "smartmill_stability_testing/oracles.h"

namespace smartmill::stability {
namespace {

/// [1] Fraction of random points outside a band of 5 % around the boundary at which solver and time domain
/// agree.
double agreement(RegenerativeSystem system, bool two_axes, int points, unsigned seed, bool may_leave = true) {
  const ModalModel x = benchmark(), y = two_axes ? benchmark() : ModalModel{};
  system.modes = systemModes(x, y);
  const auto solver = makeFloquetSolver(Method::collocation, system);
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit;
  int agree = 0, n = 0, chattering = 0;
  while (n < points) {
    const double speed = units::radPerSecFromRpm(6000.0 + 14000.0 * unit(random));
    const double reference = solver->limit(speed, 10e-3).depth;
    const double depth = (std::isfinite(reference) ? reference : 5e-3) * (0.4 + 1.2 * unit(random));
    const auto at = solver->at(speed);
    const bool chatters = at->multiplier(depth).radius() > 1.0;
    // Outside the band: the same result at 5 % larger and smaller depth.
    if ((at->multiplier(1.05 * depth).radius() > 1.0) != chatters ||
        (at->multiplier(0.95 * depth).radius() > 1.0) != chatters)
      continue;
    const bool simulated = chattersInTime(system, x, y, speed, depth, 0.1e-3, may_leave);
    if (simulated != chatters)
      std::cout << "  differs at " << units::rpmFromRadPerSec(speed) << " rpm, " << depth * 1e3
                << " mm (limit " << reference * 1e3 << "): multiplier " << at->multiplier(depth).radius()
                << ", in time " << simulated << '\n';
    agree += simulated == chatters;
    chattering += chatters;
    ++n;
  }
  std::cout << agree << " of " << n << " points agree, " << chattering << " of them chatter\n";
  return static_cast<double>(agree) / n;
}

/// 400 points if SMARTMILL_STUDY is set.
int points(int few) {
  return std::getenv("SMARTMILL_STUDY") ? 400 : few;
}

TEST(TimeDomain, agreesOutsideTheBand) {
  EXPECT_GE(agreement(benchmarkSystem(0.5, true, true), true, points(16), 1), 0.98);
}

TEST(TimeDomain, agreesInASlot) {
  EXPECT_GE(agreement(benchmarkSystem(1.0, true, false), false, points(16), 2), 0.98);
}

TEST(TimeDomain, agreesWithHelix) {
  RegenerativeSystem system = benchmarkSystem(0.5, true, true);
  system.helix = units::radFromDeg(30.0);
  EXPECT_GE(agreement(system, true, points(10), 3), 0.98);
}

// With uneven pitch the forced vibration and the chips differ from tooth to tooth, and teeth leave thin chips
// early: a nonlinear effect, absent from linear theory, which moves the boundary by up to 10 %. Here teeth do
// not leave.
TEST(TimeDomain, agreesWithHelixAndUnevenPitch) {
  RegenerativeSystem system = benchmarkSystem(0.5, true, true);
  system.helix = units::radFromDeg(30.0);
  system.pitch = {units::radFromDeg(170.0), units::radFromDeg(190.0)};
  EXPECT_GE(agreement(system, true, points(10), 4, false), 0.98);
}

// The limit of this flip is less than half the zero-order limit.
TEST(TimeDomain, findsTheFlipThatZeroOrderMisses) {
  const RegenerativeSystem system = benchmarkSystem(0.05, true, true);
  const double speed = units::radPerSecFromRpm(20000.0);
  // 3.250386 mm in the tables, 6.850 mm by the zero-order solution.
  EXPECT_FALSE(chattersInTime(system, benchmark(), benchmark(), speed, 3.18e-3, 0.1e-3));
  EXPECT_TRUE(chattersInTime(system, benchmark(), benchmark(), speed, 3.32e-3, 0.1e-3));
}

}  // namespace
}  // namespace smartmill::stability
