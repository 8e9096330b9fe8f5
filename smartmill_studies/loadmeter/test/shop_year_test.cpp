#include "loadmeter/shop_year.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace smartmill::loadmeter {
namespace {

TEST(ShopYear, theDatabaseLearnsAndKnowsHowWell) {
  ShopOptions options;
  options.days = 40;
  options.jobs = 3;
  options.tools = 5;
  options.materials = 4;
  const auto jobs = shopYear(options);
  ASSERT_EQ(jobs.size(), 120u);
  const auto median = [&](int from, int to) {
    std::vector<double> errors;
    for (const ShopJob& job : jobs)
      if (job.answered && job.day >= from && job.day < to) errors.push_back(job.error);
    std::sort(errors.begin(), errors.end());
    return errors.empty() ? 1.0 : errors[errors.size() / 2];
  };
  EXPECT_LT(median(20, 40), median(0, 5));
  EXPECT_LT(median(20, 40), 0.05);
  int answered = 0, inside = 0;
  for (const ShopJob& job : jobs) {
    answered += job.answered;
    inside += job.inside;
  }
  EXPECT_GT(inside, 0.85 * answered);
}

}  // namespace
}  // namespace smartmill::loadmeter
