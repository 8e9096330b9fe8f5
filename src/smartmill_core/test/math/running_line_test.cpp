#include "smartmill_core/math/running_line.h"

#include <gtest/gtest.h>

namespace smartmill {
namespace {

// Anscombe (1973), first quartet: y = 3.0001 + 0.50009 x.
TEST(RunningLine, IsAnscombesLine) {
  constexpr double X[] = {10, 8, 13, 9, 11, 14, 6, 4, 12, 7, 5};
  constexpr double Y[] = {8.04, 6.95, 7.58, 8.81, 8.33, 9.96, 7.24, 4.26, 10.84, 4.82, 5.68};
  RunningLine line;
  for (int i = 0; i < 11; ++i) line.add(X[i], Y[i]);
  EXPECT_EQ(line.count(), 11);
  EXPECT_NEAR(line.slope(), 0.50009, 1e-5);
  EXPECT_NEAR(line.level(), 3.00009, 1e-5);
  EXPECT_NEAR(line.at(9.0), 7.50091, 1e-5);
}

// Times since 1970 in seconds, of which a sum of squares keeps no millisecond.
TEST(RunningLine, KeepsTheSlopeFarFromZero) {
  RunningLine line;
  for (int i = 0; i < 100; ++i) line.add(1.8e9 + 0.25 * i, 3.0 * i);
  EXPECT_NEAR(line.slope(), 12.0, 1e-9);
}

TEST(RunningLine, NeedsTwoPlaces) {
  RunningLine line;
  EXPECT_FALSE(line.isDetermined());
  line.add(2.0, 1.0);
  line.add(2.0, 5.0);
  EXPECT_FALSE(line.isDetermined());
  line.add(3.0, 5.0);
  EXPECT_TRUE(line.isDetermined());
}

}  // namespace
}  // namespace smartmill
