#include "smartmill_stability/chatter/speed_search.h"

#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {
namespace {

const double LOW = units::radPerSecFromRpm(6000.0), HIGH = units::radPerSecFromRpm(18000.0);
constexpr int TEETH = 4;

double probabilityAt(const SpeedSearch& search, double rpm) {
  double best = 0.0, distance = 1e9;
  for (const SpeedProposal& p : search.proposals()) {
    const double off = std::abs(units::rpmFromRadPerSec(p.speed) - rpm);
    if (off >= distance) continue;
    distance = off;
    best = p.stable;
  }
  return best;
}

// Chatter at 1000 Hz: the widest pocket ends where the tooth passing frequency is the natural frequency, a
// little below 1000 Hz (15,000 rpm); half way to the next pocket (10,000 rpm: 1.5 waves between teeth) the
// limit is least.
TEST(SpeedSearch, pocketsAreWhereTheTeethMeetTheWaves) {
  SpeedSearch search(TEETH, LOW, HIGH);
  search.heard({units::radPerSecFromRpm(11500.0), 1000.0});
  EXPECT_GT(probabilityAt(search, 14500.0), 0.4);
  EXPECT_GT(probabilityAt(search, 14500.0), 2.0 * probabilityAt(search, 10600.0));
  EXPECT_LT(probabilityAt(search, 11500.0), 0.05);  // was tried
  const double next = units::rpmFromRadPerSec(search.next().speed);
  EXPECT_GT(next, 13500.0);
  EXPECT_LT(next, 15500.0);
}

// A machine with one mode, judged by the collocation solver.
TEST(SpeedSearch, findsAStableSpeedOfASimulatedMachine) {
  RegenerativeSystem system;
  system.teeth = TEETH;
  system.entry = 0.0;
  system.exit = units::PI;
  system.kt = 800e6;
  system.kr = 240e6;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    SystemMode mode;
    mode.frequency = axis == 0 ? 940.0 : 900.0;
    mode.damping_ratio = 0.02;
    mode.input[axis] = mode.output[axis] = units::TWO_PI * mode.frequency / std::sqrt(15e6);
    system.modes.push_back(mode);
  }
  const auto solver = makeFloquetSolver(Method::collocation, system);
  const double first = units::radPerSecFromRpm(9800.0);
  const double depth = 2.0 * solver->limit(first, 0.1).depth;
  SpeedSearch search(TEETH, LOW, HIGH);
  double speed = first;
  int tries = 0;
  for (; tries <= 6; ++tries) {
    const auto [multiplier, frequency] = solver->at(speed)->motion(depth);
    HeardCut cut;
    cut.speed = speed;
    if (multiplier.radius() > 1.0) cut.frequency = std::abs(frequency);
    search.heard(cut);
    if (!cut.frequency) break;
    speed = search.next().speed;
  }
  EXPECT_LE(tries, 4);
}

// A range of 2 % to both sides of the first cut: some speed is stable in every drawn machine, however narrow
// the range is.
TEST(SpeedSearch, aNarrowRangeHasProposals) {
  const double first = units::radPerSecFromRpm(9000.0);
  SpeedSearch search(TEETH, 0.98 * first, 1.02 * first);
  search.heard({first, 1000.0});
  const SpeedProposal next = search.next();
  EXPECT_GE(next.speed, 0.98 * first);
  EXPECT_LE(next.speed, 1.02 * first * (1.0 + 1e-12));
  EXPECT_GT(next.stable, 0.1);
}

TEST(SpeedSearch, theSameCutsGiveTheSameProposals) {
  SpeedSearch a(TEETH, LOW, HIGH), b(TEETH, LOW, HIGH);
  for (SpeedSearch* search : {&a, &b}) {
    search->heard({units::radPerSecFromRpm(9000.0), 800.0});
    search->heard({units::radPerSecFromRpm(12000.0), {}});
  }
  EXPECT_EQ(a.next().speed, b.next().speed);
  EXPECT_EQ(a.next().stable, b.next().stable);
}

TEST(SpeedSearch, refusesInvalidCuts) {
  EXPECT_THROW(SpeedSearch(0, LOW, HIGH), Error);
  EXPECT_THROW(SpeedSearch(TEETH, HIGH, LOW), Error);
  SpeedSearch search(TEETH, LOW, HIGH);
  EXPECT_TRUE(search.proposals().empty());
  EXPECT_THROW(search.next(), Error);
  EXPECT_THROW(search.heard({units::radPerSecFromRpm(9000.0), {}}), Error);      // stable
  EXPECT_THROW(search.heard({units::radPerSecFromRpm(20000.0), 800.0}), Error);  // out of range
  EXPECT_THROW(search.heard({units::radPerSecFromRpm(9000.0), -1.0}), Error);
}

}  // namespace
}  // namespace smartmill::stability
