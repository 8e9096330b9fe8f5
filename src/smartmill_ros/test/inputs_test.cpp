#include "smartmill_ros/inputs.h"

#include <gtest/gtest.h>

#include "smartmill_core/error.h"

namespace smartmill {
namespace {

void refuse() {
  throw Error("channel fx is missing");
}

TEST(InputHealth, ExceptionsOfAHandlerAreCaughtAndLoggedAtIntervals) {
  InputHealth input("daq/dynamometer", 1.0);
  int handled = 0;
  EXPECT_EQ(input.take(10.0, [&] { ++handled; }), "");
  EXPECT_EQ(input.take(10.1, refuse), "daq/dynamometer: channel fx is missing");
  EXPECT_EQ(input.take(10.2, refuse), "");  // not logged again at once
  EXPECT_EQ(input.take(16.0, refuse), "daq/dynamometer: channel fx is missing");
  EXPECT_EQ(input.take(16.1, [] { throw std::runtime_error("anything"); }), "");
  EXPECT_EQ(input.refused(), 4u);
  EXPECT_EQ(handled, 1);
}

TEST(InputHealth, EveryProblemIsReportedAtLeastOnce) {
  InputHealth input("daq/dynamometer", 1.0);
  input.take(1.0, refuse);
  input.take(1.1, [] {});
  EXPECT_EQ(input.takeProblem(), "channel fx is missing");  // although it is over
  EXPECT_EQ(input.takeProblem(), "");
  input.take(2.0, refuse);
  EXPECT_EQ(input.takeProblem(), "channel fx is missing");
  EXPECT_EQ(input.takeProblem(), "channel fx is missing");  // it persists
  input.take(2.1, [] {});
  EXPECT_EQ(input.takeProblem(), "");
}

TEST(InputHealth, ARefusedMessageResetsTheWatchdog) {
  InputHealth input("daq/dynamometer", 1.0);
  input.take(5.0, refuse);
  input.watchdog().tick(0.5);
  EXPECT_FALSE(input.watchdog().dead());
  input.watchdog().tick(1.0);
  EXPECT_TRUE(input.watchdog().dead());
}

// Numbers of the headers of one publisher: 1, 2, 5, then those of its successor from 1 on.
TEST(InputHealth, MessagesAreCountedByTheNumbersOfTheirHeaders) {
  InputHealth input("daq/dynamometer", 1.0);
  for (const std::uint32_t number : {7u, 8u, 11u, 1u, 2u, 4u}) input.count("/sim", number);
  for (const std::uint32_t number : {900u, 901u}) input.count("/faults", number);
  EXPECT_EQ(input.account("").lost, 3u);
}

TEST(InputHealth, EveryMessageIsProcessedWaitingDroppedOrRefused) {
  InputHealth input("daq/dynamometer", 1.0);
  for (int k = 0; k < 10; ++k) input.take(k, [] {});
  for (int k = 0; k < 3; ++k) input.take(k, [&] { input.drop(); });
  for (int k = 0; k < 2; ++k) input.take(k, refuse);
  input.setWaiting([] { return std::size_t{4}; });
  const smartmill_msgs::StreamHealth account = input.account("/smartmill/daq/dynamometer");
  EXPECT_EQ(account.topic, "/smartmill/daq/dynamometer");
  EXPECT_EQ(account.received, 15u);
  EXPECT_EQ(account.dropped, 3u);
  EXPECT_EQ(account.refused, 2u);
  EXPECT_EQ(account.waiting, 4u);
  EXPECT_EQ(account.processed, 6u);
}

}  // namespace
}  // namespace smartmill
