#include "smartmill_launch/comparison/offline_comparison.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill::report {
namespace {

constexpr double NONE = std::numeric_limits<double>::infinity();

TEST(Agreement, DifferencesCountAgainstTheLargestOfASeries) {
  Agreement agreement;
  agreement.add({1.0, -200.0, 3.0}, {1.0, -200.0, 3.0 + 2e-7});
  EXPECT_EQ(agreement.compared, 3u);
  EXPECT_NEAR(agreement.largest, 1e-9, 1e-15);
  EXPECT_TRUE(agreement.same(2e-9));
  EXPECT_FALSE(agreement.same(0.5e-9));
}

TEST(Agreement, WhatOnlyOneSideHasIsMissing) {
  Agreement agreement;
  agreement.add({1.0, NONE, std::nan("")}, {1.0, std::nan(""), NONE});  // neither says a number: they agree
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

TEST(NumberTable, ColumnsWithUnitsAndEmptyCells) {
  const TemporaryFolder folder;
  const NumberTable table =
      readNumberTable(folder.write("table.csv", "time[s],fx[N],limit_mm\n0.5,-1.25e3,\n1,nan,2\n"));
  EXPECT_EQ(table.column("fx")[0], -1250.0);
  EXPECT_TRUE(std::isnan(table.column("fx")[1]));
  EXPECT_TRUE(std::isnan(table.column("limit_mm")[0]));
  EXPECT_THROW(table.column("fy"), Error);
  EXPECT_THROW(readNumberTable(folder.write("short.csv", "time[s],fx[N]\n0.5\n")), Error);
  EXPECT_THROW(readNumberTable(folder.write("word.csv", "time[s]\nabc\n")), Error);
  EXPECT_THROW(readNumberTable(folder.file("absent.csv")), Error);
}

}  // namespace
}  // namespace smartmill::report
