#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "smartmill_cnc/bridge.h"
#include "smartmill_core/units.h"
#include "test_machine.h"

namespace smartmill::cnc {

constexpr double PERIOD = 0.02;  // [s]

class BridgeTest : public ::testing::Test {
 protected:
  BridgeTest() {
    startServer(0);
    connectBridge(port_);
  }

  void startServer(std::uint16_t port) {
    focas::ServerOptions options;
    options.port = port;
    server_ = std::make_unique<focas::Server>(options, machine_.calls());
    port_ = server_->port();
  }

  void connectBridge(std::uint16_t port, double reply_timeout = 10.0) {
    FocasParameters focas;
    focas.port = port;
    focas.reply_timeout = reply_timeout;
    focas.override_data = override_data_;
    MotionParameters motion;
    motion.read_only = false;
    motion.limits.travel = {{{-0.2, 0.2}, {-0.2, 0.2}, {-0.2, 0.2}}};
    motion.limits.max_feed = 0.5;
    motion.limits.max_spindle_speed = units::radPerSecFromRpm(12000.0);
    bridge_ = std::make_unique<Bridge>(makeFocasController(focas), 1.0, motion);
  }

  void cycle() {
    bridge_->fetch(now_);
    bridge_->step(now_);
    for (LogEntry& entry : bridge_->takeLogEntries()) {
      log_lines_.push_back(entry.text);
    }
    machine_.advance(PERIOD);
    now_ += PERIOD;
    // Gives the server's thread time to transfer text; the test's own time does not advance here.
    std::this_thread::sleep_for(std::chrono::microseconds(200));
  }

  bool cycleUntil(const std::function<bool()>& condition, int most = 20000) {
    for (int i = 0; i < most; ++i) {
      if (condition()) {
        return true;
      }
      cycle();
    }
    return false;
  }

  Outcome finish() {
    std::optional<Outcome> outcome;
    EXPECT_TRUE(cycleUntil([&] { return (outcome = bridge_->takeOutcome()).has_value(); }));
    return outcome.value_or(Outcome{MotionCode::busy, "no outcome"});
  }

  void arm() {
    cycle();
    ASSERT_TRUE(bridge_->state().connected);
    const Answer<ArmCode> answer = bridge_->arm(true);
    ASSERT_EQ(answer.code, ArmCode::ok) << answer.message;
    ASSERT_TRUE(bridge_->state().armed);
  }

  bool logged(const std::string& part) const {
    return std::any_of(log_lines_.begin(), log_lines_.end(),
                       [&](const std::string& entry) { return entry.find(part) != std::string::npos; });
  }

  TestMachine machine_;
  std::unique_ptr<focas::Server> server_;
  std::uint16_t port_ = 0;
  std::unique_ptr<Bridge> bridge_;
  int override_data_ = -1;
  double now_ = 100.0;  // [s]
  std::vector<std::string> log_lines_;
};

}  // namespace smartmill::cnc
