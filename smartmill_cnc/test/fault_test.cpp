// Faults of the connection and at the panel: each is logged in one line, ends the motion and disarms; nothing
// moves afterwards without a request.
#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <random>
#include <thread>

#include "bridge_rig.h"
#include "fault_proxy.h"

namespace smartmill::cnc {
namespace {

using focas::Bytes;
using focas::Frame;

class FaultTest : public BridgeTest {
 protected:
  /// The motions of one measurement with the automatic hammer (Dunwoody chapter 4), shortened.
  std::optional<Outcome> startStep(std::size_t step) {
    switch (step) {
      case 0:
      case 2:
        return bridge_->orient(0.5 * static_cast<double>(step + 1));
      case 1:  // to the station: up, over, down
        return bridge_->runProgram("to the station", "G91 G0 Z50\nX30 Y-10\nG1 Z-40 F1002\n", {});
      case 3:  // from the tip to the height of the hammer
        return bridge_->runProgram("to the hammer", "G91 G1 Z-7.5 F1002\n", {});
      case 4:
        return bridge_->jog("x", 50e-6, 1e-3);
      default:  // retract
        return bridge_->runProgram("retract", "G91 G1 X-5 F1002\nG0 Z50\n", {});
    }
  }
  static constexpr std::size_t STEPS = 6;

  void expectStandstill(const std::string& after) {
    // The controller detects a lost connection in its own thread.
    for (int i = 0; i < 2000 && machine_.streaming(); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    EXPECT_FALSE(machine_.streaming()) << after;
    const auto before = machine_.machinePosition();
    const std::string text = machine_.get(machine_.all_text);
    for (int i = 0; i < 100; ++i) {
      cycle();
    }
    EXPECT_EQ(machine_.machinePosition(), before) << after;
    EXPECT_EQ(machine_.get(machine_.all_text), text) << after;
    EXPECT_EQ(machine_.get(machine_.speed), 0.0) << after;
  }
  /// Arms again; a jog works then.
  void expectWorksAgain(const std::string& after) {
    cycle();
    EXPECT_TRUE(cycleUntil([&] { return bridge_->state().connected; })) << after;
    ASSERT_FALSE(bridge_->state().armed) << after;
    EXPECT_EQ(bridge_->jog("x", 1e-3, 0.01)->code, MotionCode::not_armed) << after;
    arm();
    ASSERT_FALSE(bridge_->jog("x", 1e-3, 0.01)) << after;
    EXPECT_EQ(finish().code, MotionCode::ok) << after;
  }
  std::size_t lines(const std::string& part) const {
    return static_cast<std::size_t>(
        std::count_if(log_lines_.begin(), log_lines_.end(),
                      [&](const std::string& entry) { return entry.find(part) != std::string::npos; }));
  }
};

TEST_F(FaultTest, ServerKilledAndRestartedAtEachStepOfTheHammerSequence) {
  for (std::size_t step = 0; step < STEPS; ++step) {
    for (const bool early : {true, false}) {
      const std::string what = "step " + std::to_string(step) + (early ? " early" : " late");
      if (!bridge_->state().armed) {
        EXPECT_TRUE(cycleUntil([&] { return bridge_->state().connected; }));
        arm();
      }
      machine_.change([](TestMachine& m) { m.speed = 300.0; });
      ASSERT_FALSE(startStep(step)) << what;
      for (int i = early ? 0 : 3; i > 0; --i) {
        cycle();
      }
      log_lines_.clear();
      server_.reset();
      const Outcome outcome = finish();
      EXPECT_EQ(outcome.code, MotionCode::lost) << what;
      EXPECT_NE(outcome.message.find("127.0.0.1:"), std::string::npos) << outcome.message;
      EXPECT_FALSE(bridge_->state().connected) << what;
      EXPECT_EQ(lines("trying again"), 1u) << what;
      machine_.advance(1.0);
      machine_.change([](TestMachine& m) { m.speed = 0.0; });
      startServer(port_);
      expectStandstill(what);
      expectWorksAgain(what);
    }
  }
}

TEST_F(FaultTest, ConnectionCutWithinAFrame) {
  for (const std::size_t left : {1u, 9u, 10u, 11u, 40u}) {
    std::atomic<bool> cut{false};
    FaultProxy proxy(port_, FaultProxy::forward, [&](const Frame& frame) {
      Bytes bytes = FaultProxy::bytesOf(frame);
      if (!cut || frame.type != focas::FRAME_DATA) {
        return FaultProxy::Verdict{{}, bytes, false};
      }
      bytes.resize(std::min<std::size_t>(left, bytes.size() - 1));
      return FaultProxy::Verdict{{}, bytes, true};
    });
    connectBridge(proxy.port);
    cycleUntil([&] { return bridge_->state().connected; });
    arm();
    ASSERT_FALSE(bridge_->jog("x", 0.05, 0.01));
    cycleUntil([&] { return bridge_->state().motion; });
    cut = true;
    const Outcome outcome = finish();
    EXPECT_EQ(outcome.code, MotionCode::lost) << left;
    EXPECT_NE(outcome.message.find("the controller closed it"), std::string::npos) << outcome.message;
    cut = false;
    expectStandstill("cut after " + std::to_string(left));
    expectWorksAgain("cut after " + std::to_string(left));
  }
}

TEST_F(FaultTest, RepliesByteByByteAreAccepted) {
  FaultProxy proxy(port_);
  proxy.byte_by_byte = true;
  connectBridge(proxy.port);
  ASSERT_TRUE(cycleUntil([&] { return bridge_->state().connected; }));
  arm();
  ASSERT_FALSE(bridge_->runProgram("slot", "G91 G1 X1 F3000\nX-1\n", {}));
  EXPECT_EQ(finish().code, MotionCode::ok);
}

TEST_F(FaultTest, TenThousandBytesInFrontOfAReplyDoNotMoveTheMachine) {
  std::atomic<bool> flood{false};
  FaultProxy proxy(port_, FaultProxy::forward, [&](const Frame& frame) {
    Bytes bytes;
    if (flood && frame.type == focas::FRAME_DATA) {
      // Unrequested frames, then the reply, in one block.
      const Bytes other = focas::encodeFrame(0x33, 2, Bytes(90, 7), 3);
      while (bytes.size() < 10000) {
        bytes.insert(bytes.end(), other.begin(), other.end());
      }
    }
    const Bytes reply = FaultProxy::bytesOf(frame);
    bytes.insert(bytes.end(), reply.begin(), reply.end());
    return FaultProxy::Verdict{{}, bytes, false};
  });
  connectBridge(proxy.port);
  ASSERT_TRUE(cycleUntil([&] { return bridge_->state().connected; }));
  arm();
  flood = true;
  ASSERT_FALSE(bridge_->jog("x", 1e-3, 0.01));
  EXPECT_EQ(finish().code, MotionCode::ok);
}

/// Wrong version, length, opcode, count and magic number: each ends the connection with one line.
TEST_F(FaultTest, WrongRepliesEndTheConnection) {
  const std::map<std::string, std::function<Bytes(Frame)>> wrongs{{"version 0",
                                                                   [](Frame f) {
                                                                     f.version = 0;
                                                                     return FaultProxy::bytesOf(f);
                                                                   }},
                                                                  {"a length that is too long",
                                                                   [](Frame f) {
                                                                     f.body.at(2) = 0xff;
                                                                     return FaultProxy::bytesOf(f);
                                                                   }},
                                                                  {"a length of 0",
                                                                   [](Frame f) {
                                                                     f.body.at(2) = f.body.at(3) = 0;
                                                                     return FaultProxy::bytesOf(f);
                                                                   }},
                                                                  {"another opcode",
                                                                   [](Frame f) {
                                                                     f.body.at(9) ^= 0x55;
                                                                     return FaultProxy::bytesOf(f);
                                                                   }},
                                                                  {"fewer replies",
                                                                   [](Frame f) {
                                                                     f.body.at(1) = 1;
                                                                     return FaultProxy::bytesOf(f);
                                                                   }},
                                                                  {"no magic", [](const Frame& f) {
                                                                     Bytes bytes = FaultProxy::bytesOf(f);
                                                                     bytes[1] = 0x00;
                                                                     return bytes;
                                                                   }}};
  for (const auto& [what, spoil] : wrongs) {
    std::atomic<bool> wrong{false};
    FaultProxy proxy(port_, FaultProxy::forward, [&, &make = spoil](const Frame& frame) {
      const bool now = wrong && frame.type == focas::FRAME_DATA;
      return FaultProxy::Verdict{{}, now ? make(frame) : FaultProxy::bytesOf(frame), false};
    });
    connectBridge(proxy.port, 1.0);
    ASSERT_TRUE(cycleUntil([&] { return bridge_->state().connected; })) << what;
    arm();
    ASSERT_FALSE(bridge_->jog("x", 0.05, 0.01)) << what;
    cycleUntil([&] { return bridge_->state().motion; });
    wrong = true;
    EXPECT_EQ(finish().code, MotionCode::lost) << what;
    wrong = false;
    expectStandstill(what);
    expectWorksAgain(what);
  }
}

TEST_F(FaultTest, EveryErrorCodeOfAStartIsReportedAndMovesNothing) {
  arm();
  bridge_->arm(false);
  for (int code = -17; code <= 18; ++code) {
    if (code == focas::EW_OK) {
      continue;
    }
    machine_.change([&](TestMachine& m) { m.refuse_start = static_cast<focas::EwCode>(code); });
    cycle();
    const Answer<ArmCode> answer = bridge_->arm(true);
    EXPECT_NE(answer.code, ArmCode::ok) << code;
    EXPECT_EQ(answer.message.rfind("motion is not armed: ", 0), 0u) << answer.message;
    EXPECT_FALSE(bridge_->state().armed) << code;
  }
  machine_.change([](TestMachine& m) { m.refuse_start = focas::EW_OK; });
  expectStandstill("refused starts");
  expectWorksAgain("refused starts");
}

TEST_F(FaultTest, ResetAndEmergencyStopDuringDnc) {
  std::string program = "G91 G1 F30000\n";
  for (int i = 0; i < 2000; ++i) {
    program += i % 2 == 0 ? "X0.5\n" : "X-0.5\n";
  }
  for (const bool emergency : {false, true}) {
    arm();
    ASSERT_FALSE(bridge_->runProgram("zigzag", program, {}));
    for (int i = 0; i < 5; ++i) {
      cycle();
    }
    EXPECT_EQ(bridge_->progress().stage, "sending");
    if (emergency) {
      machine_.change([](TestMachine& m) { m.state.emergency = 1; });
    }
    machine_.resetKey();
    const Outcome outcome = finish();
    EXPECT_EQ(outcome.code, emergency ? MotionCode::alarm : MotionCode::cancelled) << outcome.message;
    EXPECT_NE(outcome.message.find(emergency ? "emergency stop" : "reset"), std::string::npos);
    EXPECT_FALSE(bridge_->state().armed);
    if (emergency) {
      EXPECT_EQ(bridge_->arm(true).code, ArmCode::alarm);
    }
    expectStandstill("emergency or reset");
    machine_.change([](TestMachine& m) { m.state.emergency = 0; });
    expectWorksAgain("emergency or reset");
    bridge_->arm(false);
  }
}

TEST_F(FaultTest, AlarmDuringAJogIsPublishedTypedAndStops) {
  arm();
  ASSERT_FALSE(bridge_->jog("x", 0.05, 0.01));
  cycleUntil([&] { return bridge_->state().motion; });
  machine_.change([](TestMachine& m) {
    m.alarm_bits = 1U << 15;
    m.state.alarm = 1;
    m.alarms = {{3003, 15, 0, "TOOL MET HAMMER x"}, {500, 4, 1, "(+) OVERTRAVEL X"}};
  });
  EXPECT_EQ(finish().code, MotionCode::alarm);
  ASSERT_EQ(bridge_->alarms().size(), 2u);
  EXPECT_EQ(bridge_->alarms()[0].number, 3003);
  EXPECT_EQ(bridge_->alarms()[1].axis, 1);
  expectStandstill("alarm");
  machine_.change([](TestMachine& m) {
    m.alarm_bits = 0;
    m.state.alarm = 0;
    m.alarms.clear();
  });
  expectWorksAgain("alarm");
  EXPECT_TRUE(bridge_->alarms().empty());
}

TEST_F(FaultTest, TheSixthSessionIsRefusedWithTheReason) {
  std::list<std::unique_ptr<Bridge>> others;
  std::swap(others.emplace_back(), bridge_);
  for (int i = 0; i < 5; ++i) {
    connectBridge(port_);
    cycle();
    std::swap(others.emplace_back(), bridge_);
  }
  connectBridge(port_);
  cycle();
  EXPECT_FALSE(bridge_->state().connected);
  EXPECT_TRUE(logged("all its sessions may be taken"));
  others.clear();
  now_ += 10.0;
  EXPECT_TRUE(cycleUntil([&] {
    now_ += 1.0;
    return bridge_->state().connected;
  }));
}

TEST_F(FaultTest, AHalfOpenConnectionIsDetectedWithinTwoSeconds) {
  FaultProxy proxy(port_);
  connectBridge(proxy.port, 0.5);  // as shipped
  ASSERT_TRUE(cycleUntil([&] { return bridge_->state().connected; }));
  arm();
  ASSERT_FALSE(bridge_->jog("x", 0.05, 0.01));
  cycleUntil([&] { return bridge_->state().motion; });
  proxy.stalled = true;
  // Independent of the computer's speed: counts polls, each bounded by the reply timeout.
  int polls = 0;
  std::optional<Outcome> outcome;
  while (!(outcome = bridge_->takeOutcome()) && polls < 100) {
    cycle();
    ++polls;
  }
  ASSERT_TRUE(outcome);
  EXPECT_LE(polls, 4);
  EXPECT_EQ(outcome->code, MotionCode::lost);
  EXPECT_NE(outcome->message.find("no answer in time"), std::string::npos) << outcome->message;
}

/// The DNC circuit is cut while the data circuit works.
TEST_F(FaultTest, AHalfOpenDncCircuitIsDetected) {
  for (const bool in_motion : {false, true}) {
    const std::string what = in_motion ? "in a motion" : "idle";
    FaultProxy proxy(port_);
    connectBridge(proxy.port, 0.5);  // as shipped
    ASSERT_TRUE(cycleUntil([&] { return bridge_->state().connected; }));
    arm();
    if (in_motion) {
      ASSERT_FALSE(bridge_->runProgram("slow", "G91 G1 X0.5 F1\nX-0.5\n", {}));
      cycleUntil([&] { return bridge_->state().motion; });
    }
    log_lines_.clear();
    // Data in transit arrive first, so that they are not retransmitted.
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    proxy.deaf = true;
    // The kernel's timeout of 1.8 s does not follow the test's time.
    const auto began = std::chrono::steady_clock::now();
    while (bridge_->state().connected && std::chrono::steady_clock::now() - began < std::chrono::minutes(1)) {
      cycle();
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    RecordProperty(
        in_motion ? "detected_in_motion_ms" : "detected_idle_ms",
        static_cast<int>((std::chrono::steady_clock::now() - began) / std::chrono::milliseconds(1)));
    EXPECT_TRUE(logged("no reply on its DNC circuit")) << what;
    EXPECT_FALSE(bridge_->state().armed) << what;
    if (in_motion) {
      EXPECT_EQ(finish().code, MotionCode::lost);
    }
    expectStandstill(what);
    expectWorksAgain(what);
  }
}

/// Text lost in transit moves nothing; the cancel uses the data circuit.
TEST_F(FaultTest, TextLostOnTheDncCircuitIsDetected) {
  std::atomic<bool> discards{false};
  FaultProxy proxy(port_, [&](const Frame& frame) {
    const bool streamed = frame.type >= focas::FRAME_DNC_START && frame.type <= focas::FRAME_DNC_CANCEL;
    return discards && streamed ? FaultProxy::Verdict{} : FaultProxy::forward(frame);
  });
  connectBridge(proxy.port);
  ASSERT_TRUE(cycleUntil([&] { return bridge_->state().connected; }));
  arm();
  discards = true;
  ASSERT_FALSE(bridge_->runProgram("there", "G91 G1 X2 F600\n", {}));
  Outcome outcome = finish();
  EXPECT_EQ(outcome.code, MotionCode::cancelled);
  EXPECT_NE(outcome.message.find("nothing has moved for"), std::string::npos) << outcome.message;
  discards = false;
  ASSERT_FALSE(bridge_->runProgram("there and back", "G91 G1 X2 F600\nX-2\n", {}));
  cycleUntil([&] { return bridge_->state().motion; });
  discards = true;
  bridge_->cancel();
  outcome = finish();
  EXPECT_EQ(outcome.code, MotionCode::cancelled) << outcome.message;
  EXPECT_NE(outcome.message.find("stopped at"), std::string::npos) << outcome.message;
  expectStandstill("lost text");
}

TEST_F(FaultTest, AJumpOfTheClockNeitherEndsNorDelaysAMotion) {
  for (const double jump : {3600.0, -3600.0, 1e9, -1e9}) {
    cycle();
    if (!bridge_->state().armed) {
      arm();
    }
    CuttingCondition air;
    air.kind = CuttingCondition::Kind::air;
    ASSERT_FALSE(bridge_->runProgram("there and back", "G91 G1 X2 F600\nX-2\n", air));
    for (int i = 0; i < 5; ++i) {
      cycle();
    }
    now_ += jump;  // the wall clock is set during the lead of the condition
    std::optional<Outcome> outcome;
    ASSERT_TRUE(cycleUntil([&] { return (outcome = bridge_->takeOutcome()).has_value(); }, 400)) << jump;
    EXPECT_EQ(outcome->code, MotionCode::ok) << outcome->message;
    EXPECT_TRUE(logged("the clock jumped"));
    log_lines_.clear();
  }
}

TEST_F(FaultTest, ReadOnlySendsNoWriteRequest) {
  std::mutex mutex;
  std::vector<Frame> sent;
  FaultProxy proxy(port_, [&](const Frame& frame) {
    const std::lock_guard<std::mutex> lock(mutex);
    sent.push_back(frame);
    return FaultProxy::forward(frame);
  });
  FocasParameters focas;
  focas.port = proxy.port;
  MotionParameters motion;  // as shipped
  motion.limits.travel = {{{-0.2, 0.2}, {-0.2, 0.2}, {-0.2, 0.2}}};
  motion.limits.max_feed = 0.5;
  motion.limits.max_spindle_speed = 1000.0;
  bridge_ = std::make_unique<Bridge>(makeFocasController(focas), 1.0, motion);
  ASSERT_TRUE(cycleUntil([&] { return bridge_->state().connected; }));
  EXPECT_EQ(bridge_->arm(true).code, ArmCode::wrong_mode);
  EXPECT_NE(bridge_->arm(true).message.find("read_only"), std::string::npos);
  EXPECT_EQ(bridge_->setMacro(500, 1.0).code, MacroCode::refused);
  EXPECT_EQ(bridge_->jog("x", 1e-3, 0.01)->code, MotionCode::not_armed);
  EXPECT_EQ(bridge_->arm(false).code, ArmCode::ok);
  cycle();
  bridge_->shutdown();
  const std::lock_guard<std::mutex> lock(mutex);
  for (const Frame& frame : sent) {
    ASSERT_TRUE(frame.type == focas::FRAME_OPEN || frame.type == focas::FRAME_CLOSE ||
                frame.type == focas::FRAME_DATA);
    if (frame.type != focas::FRAME_DATA) {
      continue;
    }
    for (const focas::SubRequest& request : focas::decodeRequests(frame.body)) {
      for (const int writes :
           {focas::OP_START, focas::OP_RESET, focas::OP_WRITE_MACRO, focas::OP_WRITE_MACRO_DOUBLE,
            focas::OP_DELETE_PROGRAM, focas::OP_SET_CLOCK, focas::OP_PMC_WRITE, focas::OP_SELECT_PROGRAM}) {
        EXPECT_NE(request.c3, writes);
      }
    }
  }
}

TEST_F(FaultTest, AJogBeyondItsLimitIsRefusedBeforeAnythingIsSent) {
  arm();
  const std::string before = machine_.get(machine_.all_text);
  EXPECT_EQ(bridge_->jog("x", 0.101, 0.01)->code, MotionCode::limit);
  EXPECT_EQ(bridge_->jog("x", -0.101, 0.01)->message, "jog x: -101.000 mm, at most 100.000 mm");
  EXPECT_EQ(machine_.get(machine_.all_text), before);
}

}  // namespace
}  // namespace smartmill::cnc
