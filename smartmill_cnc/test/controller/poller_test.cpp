// The poller alone: when it connects, what it tells and how often.
#include "smartmill_cnc/controller/poller.h"

#include <gtest/gtest.h>

#include "../scripted_controller.h"

namespace smartmill::cnc {
namespace {

class PollerTest : public ::testing::Test {
 protected:
  // One period as the bridge goes through it.
  bool cycle(double now) {
    poller_.fetch(now);
    const bool read = poller_.take().has_value();
    if (!controller_.connected()) poller_.lost();
    for (const Note& note : log_.take()) notes_.push_back(note.text);
    return read;
  }

  ScriptedController controller_;
  Log log_;
  Poller poller_{controller_, 1.0, log_};
  std::vector<std::string> notes_;
};

TEST_F(PollerTest, ConnectsReadsAndSaysSoOnce) {
  for (int i = 0; i < 10; ++i) EXPECT_TRUE(cycle(0.02 * i));
  EXPECT_EQ(notes_, std::vector<std::string>{"connected to the scripted controller: type S, axes X Y Z"});
  EXPECT_EQ(controller_.count("connect"), 1u);
  // What was read is given once.
  EXPECT_FALSE(poller_.take());
}

TEST_F(PollerTest, AttemptsKeepTheirPeriodAndOneLine) {
  controller_.connecting = Failure{Failure::Kind::lost, "nobody there"};
  for (int i = 0; i < 500; ++i) EXPECT_FALSE(cycle(0.02 * i));
  EXPECT_EQ(controller_.count("connect"), 10u);
  EXPECT_EQ(notes_, std::vector<std::string>{"nobody there; trying again every 1.0 s"});
  // A refusal of another kind is news.
  controller_.connecting = Failure{Failure::Kind::refused, "wrong password"};
  for (int i = 500; i < 600; ++i) cycle(0.02 * i);
  EXPECT_EQ(notes_.size(), 2u);
}

TEST_F(PollerTest, TimeThatJumpsBackDoesNotPutTheNextAttemptOff) {
  controller_.connecting = Failure{Failure::Kind::lost, "nobody there"};
  cycle(1000.0);
  cycle(5.0);
  EXPECT_EQ(controller_.count("connect"), 2u);
}

TEST_F(PollerTest, LossIsOneLineAndSoIsTheReturn) {
  cycle(0.0);
  controller_.is_connected = false;
  controller_.connecting = Failure{Failure::Kind::lost, "connection refused"};
  poller_.failed("the wire is cut");
  poller_.lost();
  for (int i = 0; i < 200; ++i) cycle(1.0 + 0.02 * i);
  EXPECT_EQ(log_.take().size(), 0u);
  ASSERT_EQ(notes_.size(), 2u);
  EXPECT_EQ(notes_[1], "the wire is cut; trying again every 1.0 s");
  controller_.connecting.reset();
  cycle(10.0);
  EXPECT_EQ(notes_.size(), 3u);
}

TEST_F(PollerTest, ACommandThatFindsTheConnectionDeadVoidsWhatWasRead) {
  poller_.fetch(0.0);
  controller_.is_connected = false;
  EXPECT_FALSE(poller_.take());
}

}  // namespace
}  // namespace smartmill::cnc
