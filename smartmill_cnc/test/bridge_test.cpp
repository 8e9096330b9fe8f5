// The bridge with a simulated machine over the FOCAS protocol; the test advances the machine's time.
#include "smartmill_cnc/bridge.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "bridge_rig.h"
#include "fault_proxy.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::cnc {
namespace {

TEST_F(BridgeTest, StateAndLoadInSi) {
  machine_.change([](TestMachine& m) {
    m.position = {{10.5, -20.25, 0.001}};
    m.speed = 6000.0;
  });
  cycle();
  const CncState& state = bridge_->state();
  EXPECT_TRUE(state.connected);
  EXPECT_FALSE(state.armed);
  EXPECT_EQ(state.stamp, 100.0);
  EXPECT_EQ(state.mode, CncMode::dnc);
  EXPECT_EQ(state.axes, (std::vector<std::string>{"X", "Y", "Z"}));
  EXPECT_DOUBLE_EQ(state.position[0], 0.0105);
  EXPECT_DOUBLE_EQ(state.position[1], -0.02025);
  EXPECT_DOUBLE_EQ(state.position[2], 1e-6);
  EXPECT_DOUBLE_EQ(state.spindle_speed, 200.0 * units::PI);
  EXPECT_EQ(state.program, 7);
  ASSERT_TRUE(bridge_->load());
  EXPECT_DOUBLE_EQ(bridge_->load()->spindle_load, 0.1234);
  EXPECT_DOUBLE_EQ(bridge_->load()->spindle_speed, 200.0 * units::PI);
  EXPECT_EQ(bridge_->load()->axis_load, (std::vector<double>{0.015, 0.025, 0.035}));
  EXPECT_TRUE(logged("connected to the controller 127.0.0.1:"));
}

// Numbers of the diagnosis screen of a 30i [deg C]: 308 servo motors, 309 their encoders, 403 spindle motor.
TEST_F(BridgeTest, TemperaturesInKelvinAtASlowRate) {
  machine_.temperatures = {{308, focas::NumberedType::byte, {28.0, 31.0, 44.0}, true, 0},
                           {309, focas::NumberedType::byte, {27.0, 30.0, 43.0}, true, 0},
                           {403, focas::NumberedType::byte, {52.0}, false, 0}};
  cycle();
  ASSERT_TRUE(bridge_->temperature());
  EXPECT_EQ(bridge_->temperature()->stamp, 100.0);
  EXPECT_EQ(bridge_->temperature()->axes, (std::vector<std::string>{"X", "Y", "Z"}));
  EXPECT_DOUBLE_EQ(bridge_->temperature()->axis_motor[2], 317.15);
  EXPECT_DOUBLE_EQ(bridge_->temperature()->axis_encoder[0], 300.15);
  EXPECT_DOUBLE_EQ(bridge_->temperature()->spindle_motor, 325.15);
  int readings = 0;
  for (int i = 0; i < 600; ++i) {  // 12 s, with a period of 5 s
    cycle();
    readings += bridge_->temperature() ? 1 : 0;
  }
  EXPECT_EQ(readings, 2);
  EXPECT_FALSE(logged("machine/temperature"));
}

TEST_F(BridgeTest, TemperaturesThatTheControllerLacksAreAnnouncedOnce) {
  machine_.temperatures = {{308, focas::NumberedType::byte, {28.0, 31.0, 44.0}, true, 0}};
  for (int i = 0; i < 600; ++i) {
    cycle();
    if (!bridge_->temperature()) continue;
    EXPECT_DOUBLE_EQ(bridge_->temperature()->axis_motor[0], 301.15);
    EXPECT_TRUE(std::isnan(bridge_->temperature()->axis_encoder[0]));
    EXPECT_TRUE(std::isnan(bridge_->temperature()->spindle_motor));
  }
  const auto lines = [&] {
    return std::count_if(log_lines_.begin(), log_lines_.end(), [](const std::string& l) {
      return l.find("machine/temperature") != std::string::npos;
    });
  };
  EXPECT_EQ(lines(), 1);
  EXPECT_TRUE(logged("machine/temperature is incomplete: cnc_diagnoss 309"));
  EXPECT_TRUE(logged("cnc_diagnoss 403"));
}

TEST_F(BridgeTest, AControllerWithoutTemperaturesIsAskedOnce) {
  int readings = 0;
  for (int i = 0; i < 600; ++i) {
    cycle();
    readings += bridge_->temperature() ? 1 : 0;
  }
  EXPECT_EQ(readings, 0);
  EXPECT_TRUE(bridge_->state().connected);
  EXPECT_EQ(std::count_if(log_lines_.begin(), log_lines_.end(),
                          [](const std::string& l) { return l.find("no machine/temperature") == 0; }),
            1);
}

TEST_F(BridgeTest, ProgramRunsToItsEnd) {
  arm();
  CuttingCondition condition;
  condition.kind = CuttingCondition::Kind::cut;
  condition.name = "slot_1";
  const double start = now_;
  ASSERT_FALSE(
      bridge_->runProgram("slot", "S3000 M3\nN10 G0 X10\nN20 G1 X40 F1200\nG4 P500\nM30\n", condition));
  EXPECT_TRUE(bridge_->busy());
  std::optional<Outcome> outcome;
  double most_feed = 0.0, most_speed = 0.0;
  bool went = false;
  ASSERT_TRUE(cycleUntil([&] {
    most_feed = std::max(most_feed, bridge_->state().feed);
    most_speed = std::max(most_speed, bridge_->state().spindle_speed);
    went = went || bridge_->state().distance_to_go[0] > 0.01;
    outcome = bridge_->takeOutcome();
    return outcome.has_value();
  }));
  EXPECT_EQ(outcome->code, MotionCode::ok) << outcome->message;
  EXPECT_DOUBLE_EQ(bridge_->state().position[0], 0.040);
  EXPECT_NEAR(most_feed, 0.02, 1e-12);
  EXPECT_NEAR(most_speed, 100.0 * units::PI, 1e-9);
  EXPECT_TRUE(went);
  EXPECT_EQ(bridge_->state().spindle_speed, 0.0);
  // 30 mm at 20 mm/s and a dwell of 0.5 s cannot be faster.
  EXPECT_GT(now_ - start, 2.0);
  const std::vector<CuttingCondition> conditions = bridge_->takeConditions();
  ASSERT_EQ(conditions.size(), 2u);
  EXPECT_EQ(conditions[0].name, "slot_1");
  // Announced 0.3 s in advance.
  EXPECT_GE(conditions[0].stamp, start + 0.3);
  EXPECT_LT(conditions[0].stamp, start + 0.4);
  EXPECT_EQ(conditions[1].kind, CuttingCondition::Kind::none);
  EXPECT_GT(conditions[1].stamp, conditions[0].stamp + 2.0);
  EXPECT_FALSE(bridge_->busy());
}

TEST_F(BridgeTest, LongProgramThroughASmallBuffer) {
  arm();
  std::string program = "G91 G1 F30000\n";
  for (int i = 0; i < 3000; ++i) {
    program += i % 2 == 0 ? "X0.5\n" : "X-0.5\n";
  }
  machine_.change([](TestMachine& m) { m.all_text.clear(); });
  ASSERT_FALSE(bridge_->runProgram("zigzag", program, {}));
  cycle();
  cycle();
  // Only a part has been sent while the machine runs the first blocks.
  EXPECT_LT(bridge_->progress().bytes_sent, bridge_->progress().bytes_total);
  EXPECT_EQ(bridge_->progress().stage, "sending");
  EXPECT_EQ(finish().code, MotionCode::ok);
  const std::string text = machine_.get(machine_.all_text);
  EXPECT_EQ(std::count(text.begin(), text.end(), 'X'), 3000);
  EXPECT_NEAR(bridge_->state().position[0], 0.0, 1e-9);
}

TEST_F(BridgeTest, JogAndOrient) {
  arm();
  ASSERT_FALSE(bridge_->jog("z", -0.00873, 0.01));
  cycleUntil([&] { return bridge_->progress().distance_to_go < -0.001; });
  EXPECT_EQ(finish().code, MotionCode::ok);
  EXPECT_NEAR(bridge_->state().position[2], -0.00873, 1e-9);
  ASSERT_FALSE(bridge_->jog("X", 0.05, 0.0));
  EXPECT_EQ(finish().code, MotionCode::ok);
  EXPECT_NEAR(bridge_->state().position[0], 0.05, 1e-9);
  machine_.change([](TestMachine& m) { m.speed = 500.0; });
  ASSERT_FALSE(bridge_->orient(units::PI / 2.0));
  EXPECT_EQ(finish().code, MotionCode::ok);
  EXPECT_EQ(machine_.get(machine_.macros)[1133], 1024.0);
  EXPECT_EQ(bridge_->state().spindle_speed, 0.0);
  // One DNC session for all motions.
  EXPECT_EQ(machine_.get(machine_.starts), 1);
  EXPECT_EQ(bridge_->jog("w", 0.1, 0.0)->code, MotionCode::bad_goal);
  EXPECT_EQ(bridge_->jog("x", 0.1, -1.0)->code, MotionCode::bad_goal);
  EXPECT_EQ(bridge_->jog("x", NAN, 0.0)->code, MotionCode::bad_goal);
  EXPECT_EQ(bridge_->orient(NAN)->code, MotionCode::bad_goal);
}

// FOCAS has no feed hold: it is refused and the motion continues.
TEST_F(BridgeTest, FeedHoldIsForArmedMotionAndForControllersThatHaveIt) {
  EXPECT_EQ(bridge_->hold().code, HoldCode::not_connected);
  cycle();
  EXPECT_EQ(bridge_->hold().code, HoldCode::not_armed);
  arm();
  const Answer<HoldCode> answer = bridge_->hold();
  EXPECT_EQ(answer.code, HoldCode::refused);
  EXPECT_NE(answer.message.find("its own key"), std::string::npos) << answer.message;
  EXPECT_TRUE(bridge_->state().armed);
}

TEST_F(BridgeTest, RefusalsSendNothing) {
  EXPECT_EQ(bridge_->jog("x", 0.01, 0.0)->code, MotionCode::not_connected);
  EXPECT_EQ(bridge_->arm(true).code, ArmCode::not_connected);
  cycle();
  EXPECT_EQ(bridge_->jog("x", 0.01, 0.0)->code, MotionCode::not_armed);
  machine_.change([](TestMachine& m) { m.state.aut = focas::AUT_MEM; });
  cycle();
  EXPECT_EQ(bridge_->arm(true).code, ArmCode::wrong_mode);
  EXPECT_EQ(bridge_->jog("x", 0.01, 0.0)->code, MotionCode::wrong_mode);
  machine_.change([](TestMachine& m) {
    m.state.aut = focas::AUT_REMOTE;
    m.state.emergency = 1;
  });
  cycle();
  EXPECT_EQ(bridge_->arm(true).code, ArmCode::alarm);
  EXPECT_EQ(bridge_->jog("x", 0.01, 0.0)->code, MotionCode::alarm);
  machine_.change([](TestMachine& m) {
    m.state.emergency = 0;
    m.refuse_start = focas::EW_REJECT;
  });
  cycle();
  const Answer<ArmCode> rejected = bridge_->arm(true);
  EXPECT_EQ(rejected.code, ArmCode::wrong_mode);
  EXPECT_NE(rejected.message.find("CYCLE START"), std::string::npos);
  machine_.change([](TestMachine& m) { m.refuse_start = focas::EW_OK; });
  arm();
  const std::optional<Outcome> limit = bridge_->runProgram("far", "G0 X100\nX250\n", {});
  ASSERT_TRUE(limit);
  EXPECT_EQ(limit->code, MotionCode::limit);
  EXPECT_EQ(limit->message,
            "program far: line 2, column 1: X would go to 250 mm, limits -200 to 200 mm (machine)");
  EXPECT_EQ(bridge_->runProgram("bad", "G2 X1 Y1\n", {})->code, MotionCode::bad_goal);
  EXPECT_EQ(machine_.get(machine_.all_text), "");
  ASSERT_FALSE(bridge_->jog("x", 0.01, 0.001));
  EXPECT_EQ(bridge_->orient(0.0)->code, MotionCode::busy);
  EXPECT_EQ(finish().code, MotionCode::ok);
}

TEST_F(BridgeTest, MotionIsArmedForOneClient) {
  cycle();
  EXPECT_FALSE(bridge_->holder());
  EXPECT_EQ(bridge_->arm(true, "/a").code, ArmCode::ok);
  ASSERT_TRUE(bridge_->holder());
  EXPECT_EQ(bridge_->holder()->client, "/a");
  EXPECT_EQ(bridge_->arm(true, "/a").code, ArmCode::ok);
  const Answer<ArmCode> second = bridge_->arm(true, "/b");
  EXPECT_EQ(second.code, ArmCode::held);
  EXPECT_EQ(second.message.find("motion is armed by /a since "), 0u) << second.message;
  cycle();
  EXPECT_EQ(bridge_->holder()->client, "/a");
  // Every client can disarm.
  EXPECT_EQ(bridge_->arm(false, "/b").code, ArmCode::ok);
  EXPECT_FALSE(bridge_->holder());
  EXPECT_EQ(bridge_->arm(true, "/b").code, ArmCode::ok);
  EXPECT_EQ(bridge_->holder()->client, "/b");
  // The controller disarms.
  machine_.change([](TestMachine& m) { m.state.aut = focas::AUT_MEM; });
  cycle();
  EXPECT_FALSE(bridge_->state().armed);
  EXPECT_FALSE(bridge_->holder());
}

TEST_F(BridgeTest, WorkpieceZeroIsTakenIntoAccount) {
  machine_.change([](TestMachine& m) { m.offset = {{150.0, 0.0, 0.0}}; });
  arm();
  EXPECT_EQ(bridge_->runProgram("", "G0 X60\n", {})->code, MotionCode::limit);
  ASSERT_FALSE(bridge_->runProgram("", "G0 X-160\n", {}));
  EXPECT_EQ(finish().code, MotionCode::ok);
  EXPECT_NEAR(bridge_->state().position[0], -0.010, 1e-9);
}

TEST_F(BridgeTest, CancelStopsAndTheNextMotionWorks) {
  for (const bool reset_works : {true, false}) {
    machine_.change([&](TestMachine& m) { m.reset_works = reset_works; });
    if (!bridge_->state().armed) {
      arm();
    }
    const double from = machine_.get(machine_.position)[0];
    ASSERT_FALSE(bridge_->runProgram("slow", "G91 G1 X50 F600\n", CuttingCondition{}));
    ASSERT_TRUE(cycleUntil(
        [&] { return bridge_->state().motion && machine_.get(machine_.position)[0] > from + 5.0; }));
    bridge_->cancel();
    const Outcome outcome = finish();
    EXPECT_EQ(outcome.code, MotionCode::cancelled);
    EXPECT_NE(outcome.message.find("program slow: cancelled; stopped at X"), std::string::npos)
        << outcome.message;
    const double stopped = machine_.get(machine_.position)[0];
    EXPECT_LT(stopped, from + 10.0);
    EXPECT_TRUE(bridge_->state().armed);
    ASSERT_FALSE(bridge_->jog("z", 0.001, 0.1));
    EXPECT_EQ(finish().code, MotionCode::ok);
    EXPECT_EQ(machine_.get(machine_.position)[0], stopped);
  }
  EXPECT_EQ(machine_.get(machine_.resets), 1);
}

TEST_F(BridgeTest, CancelIsQuickDuringATransfer) {
  arm();
  std::string program = "G91 G1 F60\n";
  for (int i = 0; i < 5000; ++i) {
    program += "X0.01\n";
  }
  ASSERT_FALSE(bridge_->runProgram("long", program, {}));
  for (int i = 0; i < 10; ++i) {
    cycle();
  }
  const double before = now_;
  bridge_->cancel();
  EXPECT_EQ(finish().code, MotionCode::cancelled);
  EXPECT_LT(now_ - before, 0.5);
  const double stopped = machine_.get(machine_.position)[0];
  ASSERT_FALSE(bridge_->jog("z", 0.001, 0.1));
  EXPECT_EQ(finish().code, MotionCode::ok);
  EXPECT_EQ(machine_.get(machine_.position)[0], stopped);
}

TEST_F(BridgeTest, AlarmResetAndModeEndTheMotion) {
  arm();
  ASSERT_FALSE(bridge_->jog("x", 0.05, 0.01));
  cycleUntil([&] { return bridge_->state().motion; });
  machine_.change([](TestMachine& m) {
    m.alarm_bits = 1 << 6;
    m.state.alarm = 1;
    m.alarms = {{430, 6, 1, "X AXIS OVERHEAT"}};
  });
  Outcome outcome = finish();
  EXPECT_EQ(outcome.code, MotionCode::alarm);
  EXPECT_EQ(outcome.message, "jog x: alarm: 430 X AXIS OVERHEAT");
  EXPECT_FALSE(bridge_->state().armed);
  EXPECT_EQ(bridge_->state().alarm_text, "430 X AXIS OVERHEAT");
  machine_.change([](TestMachine& m) {
    m.alarm_bits = 0;
    m.state.alarm = 0;
    m.alarms.clear();
  });
  arm();
  EXPECT_EQ(bridge_->state().alarm_text, "");
  ASSERT_FALSE(bridge_->jog("x", 0.05, 0.01));
  cycleUntil([&] { return bridge_->state().motion; });
  machine_.resetKey();
  outcome = finish();
  EXPECT_EQ(outcome.code, MotionCode::cancelled);
  EXPECT_EQ(outcome.message, "jog x: the controller was reset");
  EXPECT_FALSE(bridge_->state().armed);
  arm();
  ASSERT_FALSE(bridge_->jog("x", 0.05, 0.01));
  cycleUntil([&] { return bridge_->state().motion; });
  machine_.change([](TestMachine& m) { m.state.aut = focas::AUT_JOG; });
  EXPECT_EQ(finish().code, MotionCode::wrong_mode);
  EXPECT_FALSE(bridge_->state().armed);
}

TEST_F(BridgeTest, ConnectionLostDuringAProgramAndRestored) {
  arm();
  CuttingCondition condition;
  condition.kind = CuttingCondition::Kind::air;
  ASSERT_FALSE(bridge_->runProgram("long", "G91 G1 X50 F60\n", condition));
  cycleUntil([&] { return bridge_->state().motion; });
  server_.reset();
  const Outcome outcome = finish();
  EXPECT_EQ(outcome.code, MotionCode::lost);
  EXPECT_EQ(outcome.message.find("program long: connection to the controller 127.0.0.1"), std::string::npos);
  EXPECT_NE(outcome.message.find("lost"), std::string::npos) << outcome.message;
  EXPECT_FALSE(bridge_->state().connected);
  EXPECT_FALSE(bridge_->state().armed);
  EXPECT_FALSE(bridge_->load());
  EXPECT_EQ(bridge_->takeConditions().size(), 2u);
  // Logged once, not in every period.
  EXPECT_EQ(std::count_if(log_lines_.begin(), log_lines_.end(),
                          [](const std::string& entry) { return entry.find("lost") != std::string::npos; }),
            1);
  log_lines_.clear();
  for (int i = 0; i < 200; ++i) {
    cycle();
  }
  EXPECT_EQ(log_lines_.size(), 0u);
  startServer(port_);
  EXPECT_TRUE(cycleUntil([&] { return bridge_->state().connected; }));
  EXPECT_EQ(bridge_->jog("x", 0.01, 0.0)->code, MotionCode::not_armed);
  arm();
  ASSERT_FALSE(bridge_->jog("x", 0.01, 0.0));
  EXPECT_EQ(finish().code, MotionCode::ok);
}

TEST_F(BridgeTest, Macros) {
  EXPECT_EQ(bridge_->setMacro(500, 1.0).code, MacroCode::not_connected);
  cycle();
  EXPECT_EQ(bridge_->setMacro(500, 1.25).code, MacroCode::ok);
  EXPECT_EQ(machine_.get(machine_.macros)[500], 1.25);
  EXPECT_EQ(bridge_->setMacro(99999, 1.0).code, MacroCode::refused);
  EXPECT_EQ(bridge_->setMacro(100, 1.0).code, MacroCode::refused);
  EXPECT_EQ(bridge_->setMacro(500, NAN).code, MacroCode::refused);
}

TEST_F(BridgeTest, DisarmEndsTheSessionProperly) {
  arm();
  ASSERT_FALSE(bridge_->jog("x", 0.001, 0.1));
  EXPECT_EQ(finish().code, MotionCode::ok);
  EXPECT_EQ(bridge_->arm(false).code, ArmCode::ok);
  EXPECT_FALSE(bridge_->state().armed);
  EXPECT_EQ(machine_.get(machine_.ends), 1);
  arm();
  EXPECT_EQ(machine_.get(machine_.starts), 2);
  ASSERT_FALSE(bridge_->jog("x", 0.05, 0.001));
  cycleUntil([&] { return bridge_->state().motion; });
  bridge_->arm(false);
  EXPECT_EQ(finish().code, MotionCode::cancelled);
  bridge_->shutdown();
  EXPECT_EQ(machine_.get(machine_.disconnects), 0);
}

TEST_F(BridgeTest, StallEndsTheMotion) {
  arm();
  // Text without an end of block: the machine waits forever.
  machine_.change([](TestMachine& m) { m.buffer_size = 3; });
  ASSERT_FALSE(bridge_->jog("x", 0.05, 0.001));
  const Outcome outcome = finish();
  EXPECT_EQ(outcome.code, MotionCode::cancelled);
  EXPECT_NE(outcome.message.find("nothing has moved for 60 s"), std::string::npos) << outcome.message;
}

/// A controller that refuses requests with more than most parts, or hangs up.
FaultProxy::Judge limited(std::size_t most, bool hang_up) {
  return [most, hang_up](const focas::Frame& frame) {
    if (frame.type != focas::FRAME_DATA || focas::decodeRequests(frame.body).size() <= most) {
      return FaultProxy::forward(frame);
    }
    focas::ErrorBody error;
    error.code = focas::EW_LENGTH;
    const focas::Bytes refusal =
        focas::encodeFrame(focas::FRAME_DATA, focas::DIR_ERROR, focas::encodeErrorBody(error), 3);
    return FaultProxy::Verdict{{}, hang_up ? focas::Bytes() : refusal, hang_up};
  };
}

TEST_F(BridgeTest, SplitsRequestsForALimitedController) {
  for (const bool hang_up : {false, true}) {
    FaultProxy controller(port_, limited(5, hang_up));
    connectBridge(controller.port);
    ASSERT_TRUE(cycleUntil([&] { return bridge_->state().connected; }, 1000));
    ASSERT_TRUE(bridge_->load());
    EXPECT_DOUBLE_EQ(bridge_->load()->spindle_load, 0.1234);
    arm();
    ASSERT_FALSE(bridge_->jog("x", 0.001, 0.01));
    EXPECT_EQ(finish().code, MotionCode::ok);
  }
  // With a smaller limit the load meters are refused; the rest works.
  FaultProxy controller(port_, limited(3, false));
  connectBridge(controller.port);
  ASSERT_TRUE(cycleUntil([&] { return bridge_->state().connected; }, 1000));
  EXPECT_FALSE(bridge_->load());
  EXPECT_EQ(bridge_->state().axes.size(), 3u);
}

MotionParameters goodMotion() {
  MotionParameters motion;
  motion.limits.travel = {{{-1, 1}, {-1, 1}, {-1, 1}}};
  motion.limits.max_feed = 1.0;
  motion.limits.max_spindle_speed = 1000.0;
  return motion;
}

TEST(BridgeParameters, AreValidated) {
  FocasParameters focas;
  EXPECT_NO_THROW(focas.validate());
  focas.port = 70000;
  EXPECT_THROW(focas.validate(), Error);
  MotionParameters motion = goodMotion();
  EXPECT_NO_THROW(motion.validate());
  motion.settle_time = NAN;
  EXPECT_THROW(motion.validate(), Error);
  EXPECT_THROW(Bridge(makeFocasController({}), 0.0, goodMotion()), Error);
}

TEST(BridgeConnect, ClosedPortIsLoggedOnce) {
  FocasParameters focas;
  focas.port = 1;
  Bridge bridge(makeFocasController(focas), 1.0, goodMotion());
  std::vector<LogEntry> notes;
  for (int i = 0; i < 500; ++i) {
    bridge.fetch(i * 0.02);
    bridge.step(i * 0.02);
    EXPECT_FALSE(bridge.state().connected);
    for (const LogEntry& entry : bridge.takeLogEntries()) {
      notes.push_back(entry);
    }
  }
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_EQ(
      notes[0].text,
      "cannot connect to the controller at 127.0.0.1:1: Connection refused; trying again every 1.0 to 8.0 s");
}

TEST_F(BridgeTest, OverridesAreWrittenToTheDataTableWhileAProgramRunsAndReset) {
  override_data_ = 500;
  connectBridge(port_);
  const auto table = [&](int number) {
    const std::map<int, int> data = machine_.get(machine_.data_table);
    const auto found = data.find(number);
    return found == data.end() ? -1 : found->second;
  };
  cycle();
  EXPECT_EQ(bridge_->setOverrides({0.9, 0.9}, "").code, OverrideCode::not_armed);
  arm();
  cycle();
  EXPECT_EQ(table(500), 100);  // reset when armed
  EXPECT_EQ(bridge_->setOverrides({0.9, 0.9}, "").message, "overrides: no program runs");
  CuttingCondition condition;
  condition.kind = CuttingCondition::Kind::cut;
  condition.name = "slot_1";
  condition.spindle_speed = units::radPerSecFromRpm(11000.0);
  ASSERT_FALSE(bridge_->runProgram("slot", "S3000 M3\nN10 G0 X10\nN20 G1 X40 F1200\nM30\n", condition));
  cycleUntil([&] { return bridge_->state().feed > 0.0; });
  const OverrideAnswer taken = bridge_->setOverrides({0.403, 0.954}, "chatter");
  EXPECT_EQ(taken.code, OverrideCode::ok) << taken.message;
  EXPECT_DOUBLE_EQ(taken.taken.feed, 0.4);
  EXPECT_DOUBLE_EQ(taken.taken.spindle, 0.95);
  EXPECT_EQ(table(500), 40);
  EXPECT_EQ(table(501), 95);
  // Beyond the limits nothing is written.
  for (const Overrides& wrong : {Overrides{0.1, 1.0}, Overrides{1.0, 1.3}, Overrides{1.0, 0.2},
                                 Overrides{NAN, 1.0}, Overrides{1.0, 1.15}}) {
    const OverrideAnswer answer = bridge_->setOverrides(wrong, "");
    EXPECT_EQ(answer.code, OverrideCode::limit) << wrong.feed << " " << wrong.spindle;
    EXPECT_EQ(answer.message.find('\n'), std::string::npos);
  }
  EXPECT_NE(bridge_->setOverrides({1.0, 1.15}, "").message.find("above the highest speed, 12000 rpm"),
            std::string::npos);  // 1.15 x 11,000
  EXPECT_EQ(table(501), 95);
  EXPECT_EQ(finish().code, MotionCode::ok);
  cycle();
  EXPECT_EQ(table(500), 100);
  EXPECT_EQ(table(501), 100);
  EXPECT_TRUE(logged("feed 40 %, spindle 95.0 %: chatter"));
}

TEST_F(BridgeTest, OverridesRefusedByTheControllerGiveOneLine) {
  arm();
  ASSERT_FALSE(bridge_->runProgram("slot", "N20 G1 X40 F1200\nM30\n", {}));
  cycleUntil([&] { return bridge_->state().feed > 0.0; });
  const OverrideAnswer answer = bridge_->setOverrides({0.9, 0.9}, "");
  EXPECT_EQ(answer.code, OverrideCode::refused);
  EXPECT_NE(answer.message.find("takes no overrides from outside"), std::string::npos) << answer.message;
  EXPECT_EQ(finish().code, MotionCode::ok);
}

}  // namespace
}  // namespace smartmill::cnc
