#include "../src/node/pacer.h"

#include <gtest/gtest.h>

namespace smartmill::sim {
namespace {

constexpr double BLOCK = 0.01;

// A block is complete when its last sample has been taken.
TEST(Pacer, followsTheWallClock) {
  Pacer pacer(100.0, BLOCK, false, 3.0);  // the pace is not used
  EXPECT_DOUBLE_EQ(pacer.start(), 100.0);
  EXPECT_NEAR(pacer.wait(100.0), BLOCK, 1e-12);
  EXPECT_NEAR(pacer.wait(100.004), 0.006, 1e-12);
  EXPECT_NEAR(pacer.wait(100.01), 0.0, 1e-12);
  pacer.proceed();
  EXPECT_NEAR(pacer.now(), 100.01, 1e-12);
  EXPECT_NEAR(pacer.wait(100.01), BLOCK, 1e-12);
  // Late blocks are made up for.
  EXPECT_NEAR(pacer.behind(100.5), 0.49, 1e-12);
  EXPECT_LT(pacer.wait(100.5), 0.0);
  pacer.proceed(49.0);
  EXPECT_NEAR(pacer.wait(100.5), BLOCK, 1e-9);
  EXPECT_EQ(pacer.heldBack(), 0.0);
}

TEST(Pacer, itsOwnClockRunsAtThePace) {
  Pacer pacer(100.0, BLOCK, true, 2.0);
  EXPECT_NEAR(pacer.wait(100.0), 0.5 * BLOCK, 1e-12);
  double wall = 100.0;
  for (int i = 0; i < 100; ++i) {
    wall += pacer.wait(wall);
    pacer.proceed();
  }
  EXPECT_NEAR(wall, 100.5, 1e-9);
  EXPECT_NEAR(pacer.now(), 101.0, 1e-9);
  EXPECT_EQ(pacer.heldBack(), 0.0);
}

// After a stall one block is simulated at once, not a burst, and the clock is late from then on.
TEST(Pacer, holdsALateClockBack) {
  Pacer pacer(100.0, BLOCK, true);
  EXPECT_NEAR(pacer.wait(101.0), 0.0, 1e-9);
  EXPECT_NEAR(pacer.heldBack(), 1.0 - BLOCK, 1e-9);
  pacer.proceed();
  EXPECT_NEAR(pacer.wait(101.0), BLOCK, 1e-9);
  EXPECT_NEAR(pacer.now(), 100.01, 1e-9);
  // Up to two blocks of delay, the jitter of the computer, are made up for.
  EXPECT_NEAR(pacer.wait(101.0 + 2.0 * BLOCK), -BLOCK, 1e-9);
  EXPECT_NEAR(pacer.heldBack(), 1.0 - BLOCK, 1e-9);
}

}  // namespace
}  // namespace smartmill::sim
