#include "smartmill_launch/comparison/offline_comparison.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace smartmill::report {
namespace {

constexpr double NONE = std::numeric_limits<double>::infinity();

TEST(Agreement, DifferencesAreRelativeToTheLargestOfASeries) {
  Agreement agreement;
  agreement.add({1.0, -200.0, 3.0}, {1.0, -200.0, 3.0 + 2e-7});
  EXPECT_EQ(agreement.compared, 3u);
  EXPECT_NEAR(agreement.largest, 1e-9, 1e-15);
  EXPECT_TRUE(agreement.same(2e-9));
  EXPECT_FALSE(agreement.same(0.5e-9));
}

TEST(Agreement, NumbersInOneSourceOnlyAreMissing) {
  Agreement agreement;
  agreement.add({1.0, NONE, std::nan("")}, {1.0, std::nan(""), NONE});  // no finite number in either: equal
  EXPECT_TRUE(agreement.same(0.0));
  agreement.add({1.0, 2.0}, {1.0});
  EXPECT_EQ(agreement.missing, 1u);
  EXPECT_FALSE(agreement.same(1.0));
  EXPECT_TRUE(agreement.same(0.0, 0.5));  // one of two compared
  Agreement holes;
  holes.add({1.0, NONE}, {1.0, 2.0});
  EXPECT_FALSE(holes.same(1.0));
  EXPECT_FALSE(Agreement().same(1.0));  // nothing was compared
}

}  // namespace
}  // namespace smartmill::report
