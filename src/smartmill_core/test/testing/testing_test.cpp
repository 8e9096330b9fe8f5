// Tests of the test helpers: they must be able to fail.
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/testing/shared_data.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill {
namespace {

/// @param stated stated over true standard deviation of the estimates
Coverage estimates(int count, double stated) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  Coverage coverage;
  for (int i = 0; i < count; ++i) coverage.add(3.0 * normal(random), 3.0 * stated);
  return coverage;
}

TEST(Coverage, acceptsCalibratedDeviationsOnly) {
  for (const int count : {Coverage::RUNS, 600, 2000}) {
    EXPECT_TRUE(estimates(count, 1.0).isCalibrated()) << count;
    EXPECT_FALSE(estimates(count, 1.0 / 1.5).isCalibrated()) << count;
    EXPECT_FALSE(estimates(count, 1.5).isCalibrated()) << count;
  }
  EXPECT_FALSE(estimates(2000, 1.1).isCalibrated());
  EXPECT_FALSE(estimates(2000, 0.9).isCalibrated());
  EXPECT_TRUE(estimates(2000, 1.1).isCalibrated(Coverage::RUNS));
}

TEST(Coverage, rejectsEmptyInputAndZeroDeviations) {
  EXPECT_FALSE(Coverage().isCalibrated());
  EXPECT_FALSE(estimates(Coverage::RUNS - 10, 1.0).isCalibrated());  // too few
  EXPECT_FALSE(estimates(2000, 1.0).isCalibrated(Coverage::RUNS - 10.0));
  EXPECT_FALSE(estimates(60, 1.0).isCalibrated(0.0, Coverage::FACTOR_OF_FEW));
  EXPECT_TRUE(estimates(Coverage::FEW, 1.0).isCalibrated(0.0, Coverage::FACTOR_OF_FEW));
  EXPECT_FALSE(estimates(Coverage::FEW, 0.5).isCalibrated(0.0, Coverage::FACTOR_OF_FEW));
  EXPECT_FALSE(estimates(Coverage::FEW, 2.0).isCalibrated(0.0, Coverage::FACTOR_OF_FEW));
  Coverage coverage = estimates(Coverage::RUNS, 1.0);
  coverage.add(0.0, 0.0);
  EXPECT_FALSE(coverage.isCalibrated());
}

// Chi-square of 200 degrees of freedom at the probabilities of -4 and 4 normal deviations: 129.78 and 290.18.
// A mean square just inside is calibrated, one just outside is not.
TEST(Coverage, hasTheLimitsOfTheTables) {
  const auto of = [](int count, double sum) {
    Coverage coverage;
    for (int i = 0; i < count; ++i) coverage.add(std::sqrt(sum / count), 1.0);
    return static_cast<bool>(coverage.isCalibrated());
  };
  EXPECT_TRUE(of(200, 129.78 * 1.01));
  EXPECT_FALSE(of(200, 129.78 * 0.99));
  EXPECT_TRUE(of(200, 290.18 * 0.99));
  EXPECT_FALSE(of(200, 290.18 * 1.01));
}

void testThatNeedsData(std::string& found) {
  SMARTMILL_SHARED_DATA(file, "inner/data.csv");
  found = file;
}

TEST(SharedData, isFoundInTheFolderOfTheEnvironmentVariable) {
  const char* const before = std::getenv("SMARTMILL_SHARED");
  const std::string previous = before ? before : "";
  const TemporaryFolder folder;
  setenv("SMARTMILL_SHARED", folder.file(".").c_str(), 1);
  EXPECT_EQ(sharedData("inner/data.csv"), "");
  std::filesystem::create_directory(folder.file("inner"));
  folder.write("inner/data.csv", "1\n");
  std::string found;
  testThatNeedsData(found);
  EXPECT_EQ(found, folder.file(".") + "/inner/data.csv");
  before ? setenv("SMARTMILL_SHARED", previous.c_str(), 1) : unsetenv("SMARTMILL_SHARED");
  EXPECT_NE(sharedFolder(), folder.file("."));
}

}  // namespace
}  // namespace smartmill
