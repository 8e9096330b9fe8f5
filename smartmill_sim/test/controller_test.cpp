#include "smartmill_sim/controller/controller.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <string>
#include <thread>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_focas/client.h"
#include "smartmill_focas/server.h"
#include "smartmill_sim/controller/nc_block.h"

#include "controller_rig.h"

namespace smartmill::sim {
namespace {

TEST(Axes, LongMoveTakesDistanceOverFeedPlusFeedOverAcceleration) {
  Machine m;
  m.start("G1 X60 Y80 F6000\n");  // 0.1 m at 0.1 m/s: 1 s + 0.1 / 2 s
  m.run(0.5);
  // After the ramp (v^2 / 2a behind v t) along the line 3:4.
  const double distance = 0.1 * 0.5 - 0.1 * 0.1 / (2.0 * 2.0);
  EXPECT_NEAR(m.states.back().position[0], 0.6 * distance, ROUND);
  EXPECT_NEAR(m.states.back().position[1], 0.8 * distance, ROUND);
  EXPECT_NEAR(m.states.back().velocity[0], 0.06, ROUND);
  EXPECT_NEAR(m.calls.axes.actualFeed(), 6000.0, 1e-8);
  EXPECT_NEAR(m.calls.axes.distanceToGo()[0], 60.0 - 600.0 * distance, 1e-9);
  EXPECT_EQ(m.calls.axes.distanceToGo()[2], 0.0);
  EXPECT_EQ(m.calls.state.status().motion, focas::MOTION_MOVES);
  EXPECT_NEAR(0.5 + m.runToEnd(1e-5), 1.05, 1.1e-5);
  EXPECT_EQ(m.controller.motion().position, (std::array<double, 3>{60.0 * 1e-3, 80.0 * 1e-3, 0.0}));
  EXPECT_EQ(m.controller.motion().velocity, (std::array<double, 3>{0.0, 0.0, 0.0}));
  EXPECT_EQ(m.calls.state.status().motion, focas::MOTION_NONE);
}

TEST(Axes, ShortMoveHasATriangularProfile) {
  Machine m;
  m.start("G01F6000Z-1.125\n");  // F reaches 0.1 m/s only from 5 mm on
  const double time = 2.0 * std::sqrt(1.125e-3 / 2.0);
  m.run(time / 2.0, time / 2.0);
  EXPECT_NEAR(m.states.back().position[2], -1.125e-3 / 2.0, ROUND);
  EXPECT_NEAR(m.states.back().velocity[2], -std::sqrt(1.125e-3 * 2.0), ROUND);
  EXPECT_NEAR(time / 2.0 + m.runToEnd(1e-5), time, 1.1e-5);
  EXPECT_EQ(m.controller.motion().position[2], -1.125 * 1e-3);
}

TEST(Axes, BlockTimesAreExactAtAnyStep) {
  const std::string program = "G0 X12.5 Y-3\nG91 G1 X-2.25 F900\nG4 P37\nG90 Y1.5 Z-20\n";
  Machine fine, coarse;
  fine.start(program);
  coarse.start(program);
  fine.run(1.4, 1e-4);
  coarse.run(1.4, 0.1);
  for (std::size_t k = 0; k < coarse.states.size(); ++k) {
    const MotionState& f = fine.states[(k + 1) * 1000 - 1];
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(coarse.states[k].position[i], f.position[i], ROUND) << "at " << 0.1 * double(k + 1);
    }
  }
}

TEST(Axes, RapidRelativeAndWorkOffset) {
  ControllerOptions options = testOptions();
  options.work_offset = {0.01, -0.02, -0.1};
  options.axes.home = {0.05, 0.0, -0.03};
  Machine m(options);
  EXPECT_EQ(m.calls.axes.machinePosition(), (std::vector<double>{50.0, 0.0, -30.0}));
  EXPECT_NEAR(m.calls.axes.absolutePosition()[2], 70.0, 1e-9);
  m.start("N10 G0 X0\n");
  const double distance = 0.04;  // from 50 to 10 mm, triangle below 0.5^2 / 2 = 0.125 m
  EXPECT_NEAR(m.runToEnd(1e-5), 2.0 * std::sqrt(distance / 2.0), 1.1e-5);
  m.send("G91 Y-5 Z2.5\nY-5\nG90 G1 F3000 Z71\r\n");
  m.runToEnd();
  EXPECT_NEAR(m.controller.motion().position[0], 0.01, ROUND);
  EXPECT_NEAR(m.controller.motion().position[1], -0.01, ROUND);
  EXPECT_NEAR(m.controller.motion().position[2], -0.029, ROUND);
  EXPECT_EQ(m.calls.state.sequenceNumber(), 10);
  EXPECT_EQ(m.calls.state.blockCount(), 4);
}

TEST(SpindleDrive, RampAndAngleInClosedForm) {
  Machine m;
  m.start("S3000 M3\nG4 X2.\n");
  const double speed = 3000.0 * RPM, ramp = speed / 500.0;
  m.run(0.3);
  EXPECT_NEAR(m.states.back().spindle_speed, 500.0 * 0.3, 1e-9);
  EXPECT_NEAR(m.states.back().spindle_angle, std::fmod(0.5 * 500.0 * 0.09, units::TWO_PI), 1e-9);
  m.run(1.2);
  EXPECT_EQ(m.states.back().spindle_speed, speed);
  const double angle = speed * (1.5 - 0.5 * ramp);
  EXPECT_NEAR(m.states.back().spindle_angle, std::fmod(angle, units::TWO_PI), 1e-9);
  EXPECT_NEAR(m.calls.axes.spindleSpeed()[0], 3000.0, 1e-9);
  EXPECT_EQ(m.calls.state.status().motion, focas::MOTION_DWELL);
}

TEST(SpindleDrive, AngleDoesNotDriftInAMillionSteps) {
  Machine m;
  m.start("S12000 M3\n");
  const double dt = 1.0 / 25600.0, speed = 12000.0 * RPM;
  for (int second = 0; second < 40; ++second) {
    m.controller.advance(dt, 25600, m.states);
  }
  // 8000 turns in 40 s less the ramp; relative rounding of 1e-15 at 5e4 rad.
  const double angle = speed * (40.0 - 0.5 * speed / 500.0);
  EXPECT_NEAR(std::remainder(m.states.back().spindle_angle - angle, units::TWO_PI), 0.0, 1e-9);
}

TEST(SpindleDrive, StopIsWaitedForAndStartIsNot) {
  Machine m;
  m.start("S6000 M3\nG4 P2000\n#101=1\nM5\n#102=1\n");
  m.run(1.999);
  EXPECT_FALSE(m.macro(101));
  m.run(0.002);
  EXPECT_EQ(m.macro(101), 1.0);
  const double stop = 6000.0 * RPM / 500.0;
  m.run(stop - 0.01);
  EXPECT_FALSE(m.macro(102));
  m.run(0.02);
  EXPECT_EQ(m.macro(102), 1.0);
  const MotionState rest = m.states.back();
  EXPECT_EQ(rest.spindle_speed, 0.0);
  m.run(1.0);
  EXPECT_EQ(m.states.back().spindle_angle, rest.spindle_angle);
}

TEST(SpindleDrive, OrientsForwardsToTheExactAngleAndHolds) {
  Machine m;
  m.start("S600 M3\nG4 P500\n");
  m.run(0.5);
  for (const int k : {1000, 999, 0, 4095, 4095}) {
    m.send("#1133=" + std::to_string(k) + "\nM119\n#100=" + std::to_string(k) + "\n");
    double last = m.controller.motion().spindle_angle;
    for (int i = 0; i < 3000 && m.macro(100) != double(k); ++i) {
      m.run(DT);
      const double turned = std::remainder(m.states.back().spindle_angle - last, units::TWO_PI);
      EXPECT_GE(turned, -ROUND) << "never backwards";
      last = m.states.back().spindle_angle;
    }
    ASSERT_EQ(m.macro(100), double(k));
    m.run(0.1);
    EXPECT_EQ(m.states.back().spindle_speed, 0.0);
    EXPECT_EQ(m.states.back().spindle_angle, units::TWO_PI * k / 4096.0);
  }
  m.send("#1133=4096\nM119\n");
  m.run(0.1);
  EXPECT_NE(m.alarmText().find("#1133"), std::string::npos) << m.alarmText();
}

TEST(SpindleDrive, SpeedIsLimitedAndProgramEndStops) {
  Machine m;
  m.start("S30000 M3\nG4 X5\nM30\n#100=1\n");
  m.run(4.9);
  EXPECT_NEAR(m.calls.axes.spindleSpeed()[0], 20000.0, 1e-9);
  m.runToEnd();
  EXPECT_EQ(m.states.back().spindle_speed, 0.0);
  EXPECT_EQ(m.macro(100), 1.0);
  m.send("G1 X1\n");  // F is reset at the end of the program
  m.run(0.1);
  EXPECT_NE(m.alarmText().find("FEED ZERO"), std::string::npos) << m.alarmText();
}

TEST(Session, BufferIsBoundedAndEmptiesAsBlocksRun) {
  ControllerOptions options = testOptions();
  options.buffer_size = 32;
  Machine m(options);
  ASSERT_EQ(m.calls.dnc.dncStart(), focas::EW_OK);
  const std::string text = "G1 F600 X1\nX2\nX3\nX4\nX5\nX6\nX7\nX8\n\n\nX9\n#100=9\n";
  std::size_t sent = m.calls.dnc.dncData(text.data(), text.size());
  EXPECT_EQ(sent, 32u);
  EXPECT_EQ(m.calls.dnc.dncData(text.data() + sent, text.size() - sent), 0u);
  m.run(0.01);  // the first block runs and is no longer in the buffer
  const std::size_t more = m.calls.dnc.dncData(text.data() + sent, text.size() - sent);
  EXPECT_EQ(more, 11u);
  for (sent += more; sent < text.size(); m.run(0.01)) {
    sent += m.calls.dnc.dncData(text.data() + sent, text.size() - sent);
  }
  EXPECT_EQ(m.calls.dnc.dncEnd(), focas::EW_OK);
  m.runToEnd();
  EXPECT_EQ(m.macro(100), 9.0);
  EXPECT_EQ(m.controller.motion().position[0], 9.0 * 1e-3);

  ASSERT_EQ(m.calls.dnc.dncStart(), focas::EW_OK);
  const std::string endless(40, '1');
  EXPECT_EQ(m.calls.dnc.dncData(endless.data(), endless.size()), 32u);
  m.run(DT);
  EXPECT_EQ(m.calls.dnc.dncAbort(), focas::EW_ALARM) << "a block longer than the buffer";
}

TEST(Session, MarkerIsSetAfterEveryBlockBeforeIt) {
  Machine m;
  m.start("%\nG1 X10 F600\n#100=7\n");
  bool marker_set = false;
  for (int i = 0; i < 2000 && !marker_set; ++i) {
    m.run(DT);
    marker_set = m.macro(100).has_value();
    if (!marker_set) {
      EXPECT_LT(m.controller.motion().position[0], 0.01);
    }
  }
  EXPECT_TRUE(marker_set);
  EXPECT_EQ(m.controller.motion().position[0], 0.01);
  EXPECT_EQ(m.calls.state.executingBlock(), "");
  EXPECT_EQ(m.calls.state.status().run, focas::RUN_STOP);
}

TEST(Session, LastBlockNeedsNoLineEndAndEndRunsTheRest) {
  Machine m;
  m.start("(first) g1 x2 f60\n#100=3");
  m.run(0.1);
  EXPECT_EQ(m.calls.state.executingBlock(), "(first) g1 x2 f60");
  EXPECT_EQ(m.calls.dnc.dncEnd(), focas::EW_OK);
  EXPECT_EQ(m.calls.dnc.dncEnd(), focas::EW_FUNC);
  EXPECT_EQ(m.calls.dnc.dncStart(), focas::EW_BUSY) << "blocks still run";
  m.runToEnd();
  EXPECT_EQ(m.macro(100), 3.0);
  EXPECT_EQ(m.calls.state.status().run, focas::RUN_RESET);
  EXPECT_EQ(m.calls.dnc.dncStart(), focas::EW_OK);
  EXPECT_EQ(m.calls.dnc.dncStart(), focas::EW_BUSY);
}

TEST(Session, ResetBrakesDropsTheProgramAndIsReportedOnce) {
  Machine m;
  m.start("S600 M3\nG1 X100 F6000\n#100=1\n");
  m.run(0.5);
  const double x = m.states.back().position[0];
  EXPECT_EQ(m.calls.programs.reset(), focas::EW_OK);
  EXPECT_EQ(m.calls.dnc.dncAbort(), focas::EW_RESET);
  EXPECT_EQ(m.calls.dnc.dncAbort(), focas::EW_OK);
  EXPECT_EQ(m.calls.dnc.dncStart(), focas::EW_BUSY) << "the axes still brake";
  m.run(1.0);
  EXPECT_NEAR(m.states.back().position[0], x + 0.1 * 0.1 / (2.0 * 2.0), ROUND);
  EXPECT_EQ(m.states.back().spindle_speed, 0.0);
  EXPECT_FALSE(m.macro(100));
  EXPECT_EQ(m.calls.axes.distanceToGo(), (std::vector<double>{0.0, 0.0, 0.0}));
  m.start("G91 G1 X1 F600\n");
  m.runToEnd();
  EXPECT_NEAR(m.controller.motion().position[0], x + 0.0025 + 0.001, ROUND);
}

TEST(Session, CancelStopsWithoutAnError) {
  Machine m;
  m.start("G1 X100 F6000\n");
  m.run(0.5);
  m.calls.dnc.dncCancel(focas::DNC_CANCEL);
  EXPECT_EQ(m.calls.dnc.dncAbort(), focas::EW_OK);
  m.run(0.1);
  EXPECT_EQ(m.controller.motion().velocity[0], 0.0);
  EXPECT_LT(m.controller.motion().position[0], 0.06);
  EXPECT_EQ(m.calls.state.status().run, focas::RUN_RESET);
}

TEST(Panel, OnlyDncModeRunsAndLeavingItStops) {
  Machine m;
  m.controller.setMode(focas::AUT_MDI);
  EXPECT_EQ(m.calls.state.status().aut, focas::AUT_MDI);
  EXPECT_EQ(m.calls.dnc.dncStart(), focas::EW_MODE);
  m.controller.setMode(focas::AUT_REMOTE);
  m.start("G1 X100 F600\n");
  m.run(0.5);
  m.controller.setMode(focas::AUT_JOG);
  EXPECT_EQ(m.calls.dnc.dncAbort(), focas::EW_MODE);
  m.run(0.1);
  EXPECT_EQ(m.states.back().velocity[0], 0.0);
}

TEST(Panel, AlarmAndEmergencyStopAndBlockTheStart) {
  Machine m;
  m.start("G1 X100 F600\n");
  m.run(0.5);
  m.controller.raiseAlarm(1001, "COOLANT EMPTY");
  EXPECT_EQ(m.calls.dnc.dncAbort(), focas::EW_ALARM);
  EXPECT_EQ(m.calls.state.status().alarm, 1);
  EXPECT_EQ(m.calls.state.alarmBits(), 1u << ALARM_EX);
  EXPECT_EQ(m.calls.dnc.dncStart(), focas::EW_ALARM);
  m.calls.programs.reset();
  EXPECT_EQ(m.calls.state.alarmBits(), 0u);
  m.run(0.5);
  m.start("S6000 M3\nG4 X10\n");
  m.run(1.0);
  m.controller.emergency(true);
  EXPECT_EQ(m.calls.state.status().emergency, 1);
  EXPECT_EQ(m.calls.dnc.dncAbort(), focas::EW_ALARM);
  m.calls.programs.reset();
  EXPECT_EQ(m.calls.dnc.dncStart(), focas::EW_ALARM);
  m.run(2.0);
  EXPECT_EQ(m.states.back().spindle_speed, 0.0);
  m.controller.emergency(false);
  EXPECT_EQ(m.calls.dnc.dncStart(), focas::EW_OK);
}

TEST(Panel, OvertravelIsRefusedBeforeAnythingMoves) {
  Machine m;
  m.start("G1 X250 F6000\n#100=1\nX250.001\n#100=2\n");
  m.runToEnd();
  EXPECT_EQ(m.macro(100), 1.0) << "the limit itself is inside";
  EXPECT_EQ(m.controller.motion().position[0], 0.25);
  ASSERT_EQ(m.calls.state.alarmMessages().size(), 1u);
  const focas::AlarmMessage alarm = m.calls.state.alarmMessages()[0];
  EXPECT_EQ(alarm.type, ALARM_OT);
  EXPECT_EQ(alarm.number, 500);
  EXPECT_EQ(alarm.axis, 1);
  EXPECT_NE(alarm.text.find("X250.001"), std::string::npos);
  EXPECT_EQ(m.calls.dnc.dncAbort(), focas::EW_ALARM);
  m.calls.programs.reset();
  m.start("G0 Z-301\n");
  m.run(DT);
  EXPECT_EQ(m.calls.state.alarmMessages()[0].number, 501);
}

// The spindle stops first: 500 rad/s2 from 1000 rpm, then the time of the change.
TEST(ToolChange, TakesTheToolOfTAtM6) {
  ControllerOptions options = testOptions();
  options.magazine = {3, 12};
  options.tool_change_time = 1.5;
  Machine m(options);
  m.start("T12\nS1000 M3\nG4 P500\nT3\n#100=1\nM6\n#100=2\n");
  m.run(0.51);
  EXPECT_EQ(m.controller.motion().tool, 0);
  EXPECT_EQ(m.macro(100), 1.0);
  const double stop = 1000.0 * RPM / options.spindle_acceleration;
  m.run(stop + 1.4);
  EXPECT_EQ(m.controller.motion().tool, 0);
  EXPECT_EQ(m.controller.motion().spindle_speed, 0.0);
  EXPECT_EQ(m.macro(100), 1.0);
  m.run(0.2);
  EXPECT_EQ(m.controller.motion().tool, 3);
  EXPECT_EQ(m.macro(100), 2.0);
}

TEST(Panel, UnknownWordsRaiseAProgramAlarmWithTheBlock) {
  for (const std::string block :
       {"G18", "G1 X1 Q2 F10", "M10",   "X",    "X1.2.3", "G0 G1 X1",      "X1 X2",     "S#99",
        "P5",  "G4 X1 P2",     "G4",    "F-5",  "#100=",  "#100",          "#100=#200", "#99=1",
        "O-1", "G1 X1",        "(open", "X1e3", "M119",   "X1234567890123"}) {
    Machine m;
    m.start("#100=1\n" + block + "\n#100=2\n");
    m.run(0.01);
    EXPECT_EQ(m.calls.dnc.dncAbort(), focas::EW_ALARM) << block;
    EXPECT_EQ(m.calls.state.alarmBits(), 1u << ALARM_PS) << block;
    EXPECT_NE(m.alarmText().find(block), std::string::npos) << m.alarmText();
    EXPECT_EQ(m.macro(100), 1.0) << block;
    EXPECT_EQ(m.controller.motion().position, (std::array<double, 3>{0.0, 0.0, 0.0})) << block;
  }
}

TEST(Macros, NumbersAndVacancy) {
  Machine m;
  for (const int number : {100, 199, 500, 999, 1133}) {
    EXPECT_FALSE(m.macro(number));
    EXPECT_EQ(m.calls.macros.writeMacro(number, 2.5), focas::EW_OK);
    EXPECT_EQ(m.macro(number), 2.5);
    EXPECT_EQ(m.calls.macros.writeMacro(number, std::nullopt), focas::EW_OK);
    EXPECT_FALSE(m.macro(number));
  }
  for (const int number : {0, 99, 200, 499, 1000, 1132, 1134}) {
    std::optional<double> value;
    EXPECT_EQ(m.calls.macros.readMacro(number, &value), focas::EW_NUMBER);
    EXPECT_EQ(m.calls.macros.writeMacro(number, 1.0), focas::EW_NUMBER);
  }
}

TEST(Options, AreChecked) {
  ControllerOptions options = testOptions();
  options.axes.home[1] = 0.3;
  EXPECT_THROW(Controller{options}, Error);
  EXPECT_NO_THROW(Controller{ControllerOptions::ofModel(MachineModel{})});
}

/// Server and client on loopback; the machine runs a hundred times faster than real time.
TEST(Wire, ProgramIsStreamedAndMarkerIsRead) {
  Machine m;
  focas::ServerOptions options;
  options.port = 0;
  focas::Server server(options, m.calls);
  focas::Client client;
  client.connect("127.0.0.1", server.port(), 20.0);
  client.writeMacro(1133, 1024.0);
  client.dncStart();
  std::string text = "\nS3000 M3\nG1 F6000\n";
  for (int i = 0; i < 400; ++i) {  // more than the capacity of buffer and socket
    text += "N" + std::to_string(i) + " X" + std::to_string(i % 2) + ".25 (some words to make it longer)\n";
  }
  text += "M119\n#100=42\n%\n";
  std::size_t sent = 0;
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(120);
  while (client.readMacro(100) != 42.0) {
    ASSERT_LT(std::chrono::steady_clock::now(), deadline);
    if (sent < text.size()) {
      sent += client.dncSend(text.data() + sent, text.size() - sent);
    }
    client.dncFlush();
    m.run(0.1);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  EXPECT_EQ(sent, text.size());
  EXPECT_EQ(client.position(focas::POSITION_MACHINE), (std::vector<double>{1.25, 0.0, 0.0}));
  EXPECT_EQ(client.actualSpeed(), 0.0);
  EXPECT_EQ(m.controller.motion().spindle_angle, units::TWO_PI / 4.0);
  EXPECT_EQ(client.sequenceNumber(), 399);
  client.dncEnd(20.0);
  m.run(DT);
  EXPECT_EQ(client.statusInfo().run, focas::RUN_RESET);

  client.dncStart();
  const std::string bad = "G1 X300 F600\n";
  client.dncSend(bad.data(), bad.size());
  int code = focas::EW_OK;
  while (code == focas::EW_OK && std::chrono::steady_clock::now() < deadline) {
    m.run(0.01);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    try {
      client.dncCheck();
    } catch (const focas::FocasError& e) {
      code = e.code();
    }
  }
  EXPECT_EQ(code, focas::EW_ALARM);
  ASSERT_EQ(client.alarmMessages().size(), 1u);
  EXPECT_EQ(client.alarmMessages()[0].number, 500);
}

}  // namespace
}  // namespace smartmill::sim
