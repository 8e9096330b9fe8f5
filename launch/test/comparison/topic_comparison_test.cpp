#include "smartmill_launch/comparison/topic_comparison.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

using smartmill::session::ResultRecord;
using smartmill::session::TopicComparison;
using smartmill::session::TopicDifference;

namespace {

constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();

ResultRecord block(int index, double value = 1.0) {
  return {"sample " + std::to_string(index), 0.01 * index, {value, NOT_A_NUMBER}, {"machine"}};
}

TopicDifference compare(const std::vector<ResultRecord>& first, const std::vector<ResultRecord>& second,
                        double slack) {
  TopicComparison comparison(slack);
  for (const ResultRecord& record : first) comparison.addFirst(record);
  for (const ResultRecord& record : second) comparison.addSecond(record);
  return comparison.result();
}

}  // namespace

TEST(TopicComparison, SameInAnyOrderWithRepetitionsAndNaN) {
  const TopicDifference same =
      compare({block(1), block(2), block(3)}, {block(3), block(1), block(2), block(1)}, 0.0);
  EXPECT_TRUE(same.same()) << same.text("force");
  EXPECT_EQ(same.common, 3u);
}

TEST(TopicComparison, ADifferenceInTheLastDigitIsFound) {
  const double next = std::nextafter(1.0, 2.0);
  const TopicDifference difference = compare({block(1), block(2)}, {block(1), block(2, next)}, 0.0);
  EXPECT_FALSE(difference.same());
  EXPECT_EQ(difference.different, 1u);
  EXPECT_EQ(difference.largest, next - 1.0);
  EXPECT_EQ(difference.where, "sample 2");
}

TEST(TopicComparison, NaNAgainstANumberAndOtherWordsDiffer) {
  EXPECT_FALSE(compare({block(1, NOT_A_NUMBER)}, {block(1)}, 0.0).same());
  ResultRecord renamed = block(1);
  renamed.words = {"dynamometer"};
  EXPECT_FALSE(compare({block(1)}, {renamed}, 0.0).same());
  ResultRecord shorter = block(1);
  shorter.values.pop_back();
  EXPECT_FALSE(compare({block(1)}, {shorter}, 0.0).same());
}

TEST(TopicComparison, EndsMayBeMissingWithinTheSlackOnly) {
  const TopicDifference ends = compare({block(1), block(2), block(3)}, {block(2), block(3), block(4)}, 0.015);
  EXPECT_TRUE(ends.same()) << ends.text("force");
  EXPECT_EQ(ends.first_ends, 1u);
  EXPECT_EQ(ends.second_ends, 1u);
  const TopicDifference far = compare({block(1), block(2), block(9)}, {block(1), block(2)}, 0.015);
  EXPECT_FALSE(far.same());
  EXPECT_EQ(far.first_only, 1u);
}

// Blocks 1 to 3 were processed before the recording of the inputs began with block 4.
TEST(TopicComparison, ResultsBeforeTheFirstInputCannotBeRepeated) {
  TopicComparison comparison(0.0);
  for (const int index : {1, 2, 3, 4, 5}) comparison.addFirst(block(index));
  for (const int index : {4, 5}) comparison.addSecond(block(index));
  EXPECT_FALSE(comparison.result().same());
  EXPECT_TRUE(comparison.result(0.04).same());
  EXPECT_EQ(comparison.result(0.04).first_ends, 3u);
  EXPECT_FALSE(comparison.result(0.025).same());  // block 3 had its input
}

TEST(TopicComparison, AMissingBlockInTheMiddleIsADifference) {
  const TopicDifference hole = compare({block(1), block(2), block(3)}, {block(1), block(3)}, 10.0);
  EXPECT_FALSE(hole.same());
  EXPECT_EQ(hole.first_only, 1u);
  EXPECT_EQ(hole.first_ends, 0u);
  EXPECT_EQ(hole.missing, "sample 2");
  const TopicDifference two = compare({block(1), block(4)}, {block(1), block(2), block(3), block(4)}, 0.0);
  EXPECT_EQ(two.second_only, 2u);
  EXPECT_EQ(two.missing, "sample 2");
}

TEST(TopicComparison, AShareMayBeMissingButNotDifferent) {
  const TopicDifference hole = compare({block(1), block(2), block(3)}, {block(1), block(3)}, 0.0);
  EXPECT_TRUE(hole.sameButFor(0.34));  // one of three
  EXPECT_FALSE(hole.sameButFor(0.33));
  EXPECT_FALSE(compare({block(1), block(2)}, {block(1), block(2, 2.0)}, 0.0).sameButFor(1.0));
}

TEST(TopicComparison, NothingInCommonIsADifferenceUnlessBothAreEmpty) {
  EXPECT_FALSE(compare({block(1)}, {}, 10.0).same());
  EXPECT_FALSE(compare({}, {block(1)}, 10.0).same());
  EXPECT_TRUE(compare({}, {}, 10.0).same());
}

TEST(TopicComparison, ARecordingThatContradictsItselfIsFound) {
  EXPECT_FALSE(compare({block(1), block(1, 2.0)}, {block(1)}, 0.0).same());
  EXPECT_FALSE(compare({block(1)}, {block(1), block(1, 2.0)}, 0.0).same());
}
