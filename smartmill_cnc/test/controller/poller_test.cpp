// The poller alone: when it connects, what it logs and how often.
#include "smartmill_cnc/controller/poller.h"

#include <gtest/gtest.h>

#include "../scripted_controller.h"

namespace smartmill::cnc {
namespace {

class PollerTest : public ::testing::Test {
 protected:
  // One period as in the bridge.
  bool cycle(double now) {
    poller_.fetch(now);
    const bool read = poller_.takeReading().has_value();
    if (!controller_.connected()) poller_.reportDisconnected();
    for (const LogEntry& entry : log_.take()) log_lines_.push_back(entry.text);
    return read;
  }

  /// Loses an established connection; later attempts fail.
  void loseConnection(const Failure& afterwards) {
    cycle(0.0);
    controller_.is_connected = false;
    controller_.connecting = afterwards;
    poller_.setError("the wire is cut");
    poller_.reportDisconnected();
    for (int i = 0; i < 200; ++i) cycle(1.0 + 0.02 * i);
  }

  ScriptedController controller_;
  Log log_;
  Poller poller_{controller_, {}, log_};
  std::vector<std::string> log_lines_;
};

TEST_F(PollerTest, ConnectsReadsAndLogsItOnce) {
  for (int i = 0; i < 10; ++i) EXPECT_TRUE(cycle(0.02 * i));
  EXPECT_EQ(log_lines_, std::vector<std::string>{"connected to the scripted controller: type S, axes X Y Z"});
  EXPECT_EQ(controller_.count("connect"), 1u);
  // Each reading is returned once.
  EXPECT_FALSE(poller_.takeReading());
}

TEST_F(PollerTest, AttemptsGetRarerAndAreLoggedOnce) {
  controller_.connecting = Failure{Failure::Kind::lost, "no server"};
  EXPECT_FALSE(cycle(0.0));
  EXPECT_TRUE(log_lines_.empty()) << "the controller may be starting";
  for (int i = 0; i < 1600; ++i) EXPECT_FALSE(cycle(0.02 * i));
  // At 0, 1, 3, 7, 15, 23, 31 s.
  EXPECT_EQ(controller_.count("connect"), 7u);
  EXPECT_EQ(log_lines_, std::vector<std::string>{"no server; trying again every 1.0 to 8.0 s"});
  // A refusal of another kind is logged.
  controller_.connecting = Failure{Failure::Kind::refused, "wrong password"};
  for (int i = 1600; i < 2100; ++i) cycle(0.02 * i);
  EXPECT_EQ(log_lines_.size(), 2u);
  // A new connection resets the intervals.
  controller_.connecting.reset();
  cycle(50.0);
  EXPECT_EQ(poller_.counts().made, 1);
  controller_.is_connected = false;
  controller_.connecting = Failure{Failure::Kind::lost, "no server"};
  const std::size_t before = controller_.count("connect");
  for (int i = 0; i < 101; ++i) cycle(51.0 + 0.02 * i);
  EXPECT_EQ(controller_.count("connect"), before + 2);
  EXPECT_EQ(poller_.counts().lost, 1);
}

TEST_F(PollerTest, ClockJumpingBackDoesNotDelayTheNextAttempt) {
  controller_.connecting = Failure{Failure::Kind::lost, "no server"};
  cycle(1000.0);
  cycle(5.0);
  EXPECT_EQ(controller_.count("connect"), 2u);
}

TEST_F(PollerTest, LossAndReconnectionAreLoggedOnce) {
  loseConnection({Failure::Kind::lost, "connection refused"});
  EXPECT_EQ(log_.take().size(), 0u);
  ASSERT_EQ(log_lines_.size(), 2u);
  EXPECT_EQ(log_lines_[1], "the wire is cut; trying again every 1.0 to 8.0 s");
  controller_.connecting.reset();
  cycle(20.0);
  EXPECT_EQ(log_lines_.size(), 3u);
}

TEST_F(PollerTest, RefusedConnectionAfterALossIsLogged) {
  loseConnection({Failure::Kind::refused, "all sessions are taken"});
  ASSERT_EQ(log_lines_.size(), 3u);
  EXPECT_EQ(log_lines_[2], "all sessions are taken; trying again every 1.0 to 8.0 s");
}

TEST_F(PollerTest, LossDuringACommandDiscardsTheReading) {
  poller_.fetch(0.0);
  controller_.is_connected = false;
  EXPECT_FALSE(poller_.takeReading());
}

}  // namespace
}  // namespace smartmill::cnc
