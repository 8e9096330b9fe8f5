#include "smartmill_discrepancy/gap/significance.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

namespace smartmill::discrepancy {
namespace {

// Closed forms: chi-square with two degrees of freedom is exponential; Benjamini-Hochberg by hand.
TEST(Significance, MatchesClosedForms) {
  EXPECT_NEAR(chiSquareTail(3.0, 2), std::exp(-1.5), 1e-12);
  EXPECT_NEAR(chiSquareTail(4.0, 4), std::exp(-2.0) * 3.0, 1e-12);
  EXPECT_GT(chiSquareTail(1e9, 2), 0.0);
  const std::vector<double> rates = falseDiscoveryRates({0.01, 0.04, 0.03, 0.5});
  EXPECT_NEAR(rates[0], 0.04, 1e-12);
  EXPECT_NEAR(rates[1], 0.16 / 3.0, 1e-12);
  EXPECT_NEAR(rates[2], 0.16 / 3.0, 1e-12);  // not above the next larger one
  EXPECT_NEAR(rates[3], 0.5, 1e-12);
}

}  // namespace
}  // namespace smartmill::discrepancy
