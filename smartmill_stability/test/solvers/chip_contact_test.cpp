#include <cmath>
#include <iostream>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_stability/solvers/delayed_system.h"
#include "smartmill_stability_testing/oracles.h"
#include "smartmill_stability_testing/time_domain.h"

namespace smartmill::stability {
namespace {

using units::radPerSecFromRpm;

constexpr double FEED = 0.1e-3, MAX_DEPTH = 10e-3;

RegenerativeSystem withChips(RegenerativeSystem system) {
  system.chip.emplace();
  system.chip->feed = FEED;
  return system;
}

// Identical teeth cut along the whole arc the surface of the previous tooth: the limit is the tabulated one.
TEST(ChipContact, identicalTeethGiveTheTabulatedLimits) {
  const RegenerativeSystem plain = benchmarkSystem(1.0, true, false);
  const auto solver = makeSolver(Method::collocation, withChips(plain));
  EXPECT_NEAR(solver->limit(radPerSecFromRpm(10000.0), MAX_DEPTH).depth * 1e3, 0.32238, 1e-5);
  EXPECT_NEAR(solver->limit(radPerSecFromRpm(15000.0), MAX_DEPTH).depth * 1e3, 0.38659, 1e-5);
}

TEST(ChipContact, slicesOfAHelixGiveTheSameAsTheIntegral) {
  RegenerativeSystem system = benchmarkSystem(0.5, true, true);
  system.helix = units::radFromDeg(30.0);
  for (const double rpm : {9000.0, 15000.0}) {
    const double speed = radPerSecFromRpm(rpm);
    const double whole = makeSolver(Method::collocation, system)->limit(speed, MAX_DEPTH).depth;
    const double sliced = makeSolver(Method::collocation, withChips(system))->limit(speed, MAX_DEPTH).depth;
    EXPECT_NEAR(sliced / whole, 1.0, 2e-3) << rpm;
  }
}

// With a serration much deeper than the feed only one tooth cuts at each height. The mean over a whole wave
// is that of a tool with one tooth (contact of the rigid tool).
TEST(ChipContact, theMeanOfADeepSerrationIsThatOfOneTooth) {
  RegenerativeSystem serrated = withChips(benchmarkSystem(0.5, true, true));
  serrated.teeth = 3;
  serrated.edge.serration_amplitude = 200.0 * FEED;
  serrated.edge.serration_wavelength = 2e-3;
  RegenerativeSystem one = benchmarkSystem(0.5, true, true);
  one.teeth = 1;
  for (const double rpm : {6000.0, 9000.0, 14000.0}) {
    const double speed = radPerSecFromRpm(rpm);
    const Limit a = makeSolver(Method::zero_order, serrated)->limit(speed, 50e-3);
    const Limit b = makeSolver(Method::zero_order, one)->limit(speed, 50e-3);
    ASSERT_TRUE(std::isfinite(b.depth)) << rpm;
    // Slices are 1/20 of the wave; a few at the intersections are cut by two teeth.
    EXPECT_NEAR(a.depth / b.depth, 1.0, 0.02) << rpm;
    EXPECT_NEAR(a.frequency / b.frequency, 1.0, 0.01) << rpm;
  }
}

TEST(ChipContact, aSerrationRaisesTheLeastLimit) {
  const RegenerativeSystem plain = [] {
    RegenerativeSystem system = benchmarkSystem(0.5, true, true);
    system.teeth = 3;
    return system;
  }();
  RegenerativeSystem serrated = withChips(plain);
  serrated.edge.serration_amplitude = 0.5e-3;
  serrated.edge.serration_wavelength = 1e-3;
  double least_plain = 1.0, least_serrated = 1.0;
  for (double rpm = 3000.0; rpm <= 3400.0; rpm += 80.0) {
    const double speed = radPerSecFromRpm(rpm);
    least_plain = std::min(least_plain, makeSolver(Method::zero_order, plain)->limit(speed, MAX_DEPTH).depth);
    least_serrated =
        std::min(least_serrated, makeSolver(Method::zero_order, serrated)->limit(speed, MAX_DEPTH).depth);
  }
  EXPECT_GT(least_serrated, 2.0 * least_plain);
  EXPECT_LT(least_serrated, 3.5 * least_plain);
}

/// Number of points at which the solver (with or without the contact) and the time-domain simulation, in
/// which teeth leave the cut, agree. The points are at least 5 % away from the boundary of the solver.
int agreement(const RegenerativeSystem& system, const std::vector<double>& offsets, int points, unsigned seed,
              bool with_contact) {
  RegenerativeSystem solved = with_contact ? withChips(system) : system;
  if (system.chip) solved = system;
  const auto solver = makeFloquetSolver(Method::collocation, solved);
  RegenerativeSystem bare = system;
  bare.chip.reset();
  bare.edge.serration_amplitude = 0.0;
  const auto bare_solver = makeFloquetSolver(Method::collocation, bare);
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit;
  int agree = 0;
  for (int n = 0; n < points;) {
    const double speed = radPerSecFromRpm(6000.0 + 14000.0 * unit(random));
    const double reference = bare_solver->limit(speed, MAX_DEPTH).depth;
    const double factor = system.chip ? 0.8 + 2.4 * unit(random) : 0.4 + 1.2 * unit(random);
    const double depth = (std::isfinite(reference) ? reference : 3e-3) * factor;
    const auto at = solver->at(speed);
    const bool chatters = at->multiplier(depth).radius() > 1.0;
    if ((at->multiplier(1.05 * depth).radius() > 1.0) != chatters ||
        (at->multiplier(0.95 * depth).radius() > 1.0) != chatters)
      continue;
    ++n;
    const int slices =
        system.chip ? static_cast<int>(20.0 * depth / system.edge.serration_wavelength) + 1 : 1;
    TimeDomain run(system, benchmark(), benchmark(), speed, depth, FEED, 720, true, slices);
    run.setRunout(offsets);
    if (system.chip) run.setSerration(system.edge.serration_amplitude, system.edge.serration_wavelength);
    const bool simulated = chattersInTime(run, 720, FEED);
    agree += simulated == chatters;
    if (simulated != chatters)
      std::cout << "  differs at " << units::rpmFromRadPerSec(speed) << " rpm, " << depth * 1e3
                << " mm: multiplier " << at->multiplier(depth).radius() << '\n';
  }
  std::cout << agree << " of " << points << " points agree\n";
  return agree;
}

// Linear theory with uneven pitch agrees at 48 of 50 points: the forced vibration differs from tooth to
// tooth, and teeth leave thin chips early. With the contact in the forced vibration all points agree.
TEST(ChipContact, unevenPitchWithTeethThatLeaveTheCut) {
  RegenerativeSystem system = benchmarkSystem(0.5, true, true);
  system.helix = units::radFromDeg(30.0);
  system.pitch = {units::radFromDeg(170.0), units::radFromDeg(190.0)};
  EXPECT_EQ(agreement(system, {}, 12, 4, true), 12);
}

TEST(ChipContact, aSerratedToolAgreesWithTheTimeDomain) {
  RegenerativeSystem system = withChips(benchmarkSystem(0.5, true, true));
  system.edge.serration_amplitude = 0.15e-3;
  system.edge.serration_wavelength = 0.2e-3;  // limits of the benchmark are tenths of a millimetre
  EXPECT_EQ(agreement(system, {}, 4, 5, true), 4);
}

TEST(ChipContact, refusesInvalidSystems) {
  RegenerativeSystem system = withChips(benchmarkSystem(0.5, true, true));
  system.chip->feed = 0.0;
  EXPECT_THROW(makeSolver(Method::collocation, system), Error);
  system.chip->feed = FEED;
  system.edge.serration_amplitude = 1e-3;
  EXPECT_THROW(makeSolver(Method::collocation, system), Error);
  system.edge.serration_amplitude = 0.0;
  system.chip->radius_offset = {0.0};
  EXPECT_THROW(makeSolver(Method::collocation, system), Error);
  system.chip->radius_offset.clear();
  EXPECT_THROW(makeSolver(Method::multi_frequency, system), Error);
}

}  // namespace
}  // namespace smartmill::stability
