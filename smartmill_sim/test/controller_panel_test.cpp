// The program dialect, the operator's panel, the memory and the collision check.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

#include "controller_rig.h"
#include "smartmill_focas/server.h"
#include "smartmill_sim/controller/collision_watch.h"
#include "smartmill_sim/controller/nc_block.h"
#include "smartmill_sim/controller/servo_recorder.h"

namespace smartmill::sim {
namespace {

std::array<double, 3> mm(double x, double y, double z) {
  return {x * 1e-3, y * 1e-3, z * 1e-3};
}

void expectAt(const Machine& m, const std::array<double, 3>& expected, const std::string& what) {
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(m.controller.motion().position[i], expected[i], 1e-9) << what << " axis " << i;
  }
}

TEST(Program, EveryWordOfTheDialectMovesToItsTarget) {
  struct Case {
    std::string text;
    std::array<double, 3> end;
  };
  ControllerOptions options = testOptions();
  options.work_offset = {0.01, 0.0, -0.1};
  for (const Case& c : std::vector<Case>{
           {"G53 G0 X12 Y-3 Z-20\n", mm(12, -3, -20)},
           {"G54 G0 X5\n", mm(15, 0, 0)},
           {"#5241=30\nG55 G0 X5 Y1\n", mm(35, 1, 0)},  // G55's x
           {"G59 G0 X5\n", mm(5, 0, 0)},
           {"G20 G91 G1 X1 F20\nG21 X1 F500\n", mm(26.4, 0, 0)},
           {"G53 G0 X50 Z-50\nG91 G28 Z0\n", mm(50, 0, 0)},
           {"G53 G0 X50 Z-50\nG90 G28 X-10 Y0\n", mm(0, 0, -50)},
           {"S600 M3\nG95 G91 G1 X2 F0.1\nM5\n", mm(2, 0, 0)},
           {"G91 G2 X10 Y-10 I0 J-10 F6000\n", mm(10, -10, 0)},
           {"G91 G3 X10 Y10 R10 F6000\n", mm(10, 10, 0)},
           {"G91 G2 X10 Y-10 Z-5 R-10 F6000\n", mm(10, -10, -5)},
           {"G2 I5 F6000\n", mm(0, 0, 0)},
           {"#1=3\n#2=[#1+4]*2\nG91 G0 X#2 Y-#1 Z-[SQRT[#1*3]/2]\n", mm(14, -3, -1.5)},
           {"#101=10*SIN[30]\nG91 G0 X#101 Y[10*COS[60]]\n", mm(5, 5, 0)},
           {"#1=1\n#[100+#1]=7\nG91 G0 X##1\n", mm(1, 0, 0)},  // ##1 is #1, which is 1
           {"G91 G0 X#33 Y2\n", mm(0, 2, 0)},                  // a word with a vacant variable is ignored
           {"#9=4\n#9=#0\nG91 G0 X#9 Y2\n", mm(0, 2, 0)},      // #0 is always vacant
           {"G91 G2 X0 R5 F6000\nG0 Y1\n", mm(0, 1, 0)},       // an arc of angle 0
           {"N10 #1=4\nN0020 #2=#1*2\nG91 G0 X#2\n", mm(8, 0, 0)},
           {"O0042(SLOT)\nN7 G94 G21 G17 G90\nG91 G0 X1 (COMMENT)\n%\n", mm(1, 0, 0)},
       }) {
    Machine m(options);
    m.start(c.text);
    m.runToEnd();
    EXPECT_EQ(m.alarmText(), "") << c.text;
    expectAt(m, c.end, c.text);
  }
}

TEST(Program, ArcKeepsItsRadiusAndItsAcceleration) {
  Machine m;
  m.start("G91 G3 X0 Y20 I0 J10 F60000\n");  // half a circle of 10 mm
  double most = 0.0;
  for (int i = 0; i < 2000; ++i) {
    m.run(DT);
    const MotionState& s = m.states.back();
    EXPECT_NEAR(std::hypot(s.position[0], s.position[1] - 0.01), 0.01, 1e-12);
    most = std::max(most, std::hypot(s.velocity[0], s.velocity[1]));
  }
  // v^2 / r may be as much as the axes' 2 m/s2.
  EXPECT_LE(most, std::sqrt(2.0 * 0.01) + 1e-12);
  EXPECT_GT(most, 0.9 * std::sqrt(2.0 * 0.01));
  expectAt(m, mm(0, 20, 0), "half circle");
}

TEST(Program, MachineCoordinatesAreApproachedInRapidTraverseInAnyMode) {
  Machine m;
  m.start("G90 G1 F60 X1\nG53 X51\n");
  // A millimetre at 1 mm/s, then 50 mm at 0.5 m/s and 2 m/s2, a triangle of 2 sqrt(s / a).
  const double creep = 1e-3 / 1e-3 + 1e-3 / 2.0, rapid = 2.0 * std::sqrt(0.05 / 2.0);
  EXPECT_NEAR(m.runToEnd(), creep + rapid, 3.0 * DT);
  expectAt(m, mm(51, 0, 0), "G53");
}

TEST(Program, ArcThatBulgesOutOfTheTravelIsRefused) {
  Machine m;
  m.start("G90 G0 X245\nG3 X245 Y20 I0 J10 F6000\n");
  m.runToEnd();
  EXPECT_NE(m.alarmText().find("OVERTRAVEL X"), std::string::npos) << m.alarmText();
}

TEST(Program, ControlFlowAndUnknownWordsAreRefusedByName) {
  for (const std::string word : {"IF", "WHILE", "GOTO"}) {
    Machine m;
    m.start(word + "[#1EQ1]10\n");
    m.run(DT);
    EXPECT_EQ(m.alarmText().substr(0, word.size() + 13), word + " IS NOT KNOWN") << m.alarmText();
  }
  for (const std::string block : {"G2 X1 R0.1 F100", "G2 X1 Y1 F100", "G3 X9 I1 F100", "#1=1/0",
                                  "#1=SQRT[-1]", "#1=[[[[[[1]]]]]]", "#1=[1", "#1=1]", "#5021=1", "#0=1",
                                  "#34=1", "#1=#34", "N5 #1", "N#1=5 X1", "#1=--1", "M6", "G41", "T1"}) {
    Machine m;
    m.start(block + "\n");
    m.run(DT);
    EXPECT_EQ(m.calls.state.alarmBits(), 1u << ALARM_PS) << block << ": " << m.alarmText();
  }
}

TEST(Panel, FeedHoldStopsOnThePathAndCycleStartResumes) {
  Machine m;
  m.start("G3 X0 Y40 I0 J20 F3000\nG4 X1.\n#100=1\n");
  m.run(0.5);
  m.controller.feedHold();
  EXPECT_EQ(m.calls.state.status().run, focas::RUN_HOLD);
  m.run(2.0);
  const std::array<double, 3> held = m.controller.motion().position;
  EXPECT_EQ(m.calls.axes.actualFeed(), 0.0);
  EXPECT_NEAR(std::hypot(held[0], held[1] - 0.02), 0.02, 1e-12);
  EXPECT_GT(std::abs(m.calls.axes.distanceToGo()[1]), 1.0);
  m.run(1.0);
  EXPECT_EQ(m.controller.motion().position, held);
  EXPECT_EQ(m.calls.programs.cycleStart(), focas::EW_OK);
  m.run(1.3);  // 62.8 mm at 50 mm/s
  EXPECT_EQ(m.calls.state.status().motion, focas::MOTION_DWELL);
  m.controller.feedHold();
  m.run(5.0);
  EXPECT_FALSE(m.macro(100)) << "the dwell waits too";
  EXPECT_EQ(m.calls.programs.cycleStart(), focas::EW_OK);
  m.runToEnd();
  EXPECT_EQ(m.macro(100), 1.0);
  expectAt(m, mm(0, 40, 0), "end");
  // RESET in feed hold drops the rest.
  m.send("G90 G1 X100 F3000\n");
  m.run(0.5);
  m.controller.feedHold();
  m.run(0.5);
  const double x = m.controller.motion().position[0];
  m.calls.programs.reset();
  m.run(1.0);
  EXPECT_EQ(m.controller.motion().position[0], x);
  EXPECT_EQ(m.calls.state.status().run, focas::RUN_RESET);
}

TEST(Panel, OverridesActAtOnce) {
  Machine m;
  m.start("S1000 M3\nG1 X200 F3000\n");
  m.run(1.0);
  EXPECT_NEAR(m.calls.axes.actualFeed(), 3000.0, 1e-6);
  m.controller.setOverrides(0.5, 1.0, 0.8);
  m.run(1.0);
  EXPECT_NEAR(m.calls.axes.actualFeed(), 1500.0, 1e-6);
  EXPECT_NEAR(m.calls.axes.spindleSpeed()[0], 800.0, 1e-6);
  m.controller.setOverrides(0.0, 1.0, 1.0);
  m.run(1.0);
  EXPECT_EQ(m.calls.axes.actualFeed(), 0.0);
  EXPECT_EQ(m.calls.state.status().run, focas::RUN_START);
  m.controller.setOverrides(1.0, 1.0, 1.0);
  // External override in the data table: multiplies the panel's; 0: no effect.
  EXPECT_EQ(m.calls.data.writePmc(focas::PmcArea::d, 500, {40, 90}), focas::EW_OK);
  m.run(0.5);
  EXPECT_NEAR(m.calls.axes.actualFeed(), 1200.0, 1e-6);
  EXPECT_NEAR(m.calls.axes.spindleSpeed()[0], 900.0, 1e-6);
  m.controller.setOverrides(0.5, 1.0, 1.0);
  m.run(0.5);
  EXPECT_NEAR(m.calls.axes.actualFeed(), 600.0, 1e-6);
  m.controller.setOverrides(1.0, 1.0, 1.0);
  EXPECT_EQ(m.calls.data.writePmc(focas::PmcArea::d, 500, {0, 0}), focas::EW_OK);
  m.run(0.5);
  EXPECT_NEAR(m.calls.axes.spindleSpeed()[0], 1000.0, 1e-6);
  m.runToEnd();
  expectAt(m, mm(200, 0, 0), "end");
}

TEST(Panel, M0WaitsForCycleStart) {
  Machine m;
  m.start("G91 G0 X1\nM0\nX1\n");
  m.run(1.0);
  expectAt(m, mm(1, 0, 0), "before M0");
  EXPECT_EQ(m.calls.state.status().run, focas::RUN_STOP);
  EXPECT_EQ(m.calls.programs.cycleStart(), focas::EW_OK);
  m.run(1.0);
  expectAt(m, mm(2, 0, 0), "after M0");
}

TEST(Panel, BackwardsAndOrientationByM19) {
  Machine m;
  m.start("S600 M4\nG4 X1.\n");
  m.run(0.9);
  EXPECT_NEAR(m.controller.motion().spindle_speed, -600.0 * RPM, 1e-9);
  EXPECT_NEAR(m.calls.axes.spindleSpeed()[0], 600.0, 1e-9);
  m.send("M19\n#100=1\n");
  m.run(3.0);
  EXPECT_EQ(m.macro(100), 1.0);
  EXPECT_EQ(m.controller.motion().spindle_speed, 0.0);
  EXPECT_EQ(m.controller.motion().spindle_angle, 0.0);
}

TEST(Spindle, LoadSlowsTheRampAndStallsBeyondTheDrivesTorque) {
  ControllerOptions options = testOptions();
  options.spindle_torque = 20.0;  // 500 rad/s2: 0.04 kg m2
  Machine m(options);
  m.controller.setSpindleTorque(5.0);
  m.start("S12000 M3\nG4 X60.\n");
  m.run(1.0);
  EXPECT_NEAR(m.states.back().spindle_speed, (20.0 - 5.0) / 0.04, 1e-6);
  m.run(4.0);
  EXPECT_NEAR(m.states.back().spindle_speed, 12000.0 * RPM, 1e-9);
  m.controller.setSpindleTorque(24.0);  // 4 N m above the torque limit
  m.run(1.0);
  EXPECT_NEAR(m.states.back().spindle_speed, 12000.0 * RPM - 4.0 / 0.04, 1e-6);
  m.controller.setSpindleTorque(0.0);
  m.run(1.0);
  EXPECT_NEAR(m.states.back().spindle_speed, 12000.0 * RPM, 1e-9);
}

TEST(Memory, ProgramsAreStoredRunAndFetched) {
  Machine m;
  m.controller.setMode(focas::AUT_MEM);
  EXPECT_EQ(m.calls.programs.storePrograms("\nO1234(SLOT 1)\nG91 G0 X1\nM30\n%"), focas::EW_OK);
  EXPECT_EQ(m.calls.programs.storePrograms("G0 X1\n%"), focas::EW_DATA);
  EXPECT_EQ(m.calls.programs.storePrograms("O7\n" + std::string(600000, ' ') + "\n%"), focas::EW_OVRFLOW);
  std::string text;
  EXPECT_EQ(m.calls.programs.fetchPrograms(1234, 1234, &text), focas::EW_OK);
  EXPECT_EQ(text, "%\nO1234(SLOT 1)\nG91 G0 X1\nM30\n%\n");
  EXPECT_EQ(m.calls.programs.fetchPrograms(9, 9, &text), focas::EW_DATA);
  EXPECT_EQ(m.calls.programs.selectProgram(9), focas::EW_DATA);
  EXPECT_EQ(m.calls.programs.selectProgram(1234), focas::EW_OK);
  EXPECT_EQ(m.calls.state.programPath(), "//CNC_MEM/USER/PATH1/O1234");
  EXPECT_EQ(m.calls.programs.cycleStart(), focas::EW_OK);
  m.run(DT);
  EXPECT_EQ(m.calls.state.runningProgram(), 1234);
  EXPECT_EQ(m.calls.programs.deleteProgram(1234), focas::EW_BUSY);
  EXPECT_EQ(m.calls.programs.storePrograms("O1234\nM30\n%"), focas::EW_BUSY);
  m.runToEnd();
  expectAt(m, mm(1, 0, 0), "run from memory");
  EXPECT_EQ(m.calls.programs.cycleStart(), focas::EW_OK);
  m.runToEnd();
  expectAt(m, mm(2, 0, 0), "run again from its first block");
  EXPECT_EQ(m.calls.programs.deleteProgram(1234), focas::EW_OK);
  EXPECT_EQ(m.calls.programs.programs().size(), 1u);  // the resident one
  EXPECT_EQ(m.calls.programs.cycleStart(), focas::EW_DATA);
}

TEST(Memory, PmcShowsTheSignalsOfTheConnectionManual) {
  Machine m;
  const auto byte = [&](focas::PmcArea area, int address) {
    focas::Bytes bytes;
    EXPECT_EQ(m.calls.data.readPmc(area, address, address, &bytes), focas::EW_OK);
    return static_cast<int>(bytes.at(0));
  };
  EXPECT_EQ(byte(focas::PmcArea::f, 3), 0x10);  // MRMT
  m.start("S1500 M3\nG1 X100 F600\n");
  m.run(2.0);
  EXPECT_EQ(byte(focas::PmcArea::f, 0), 0xe0);  // OP SA STL
  EXPECT_EQ(byte(focas::PmcArea::f, 40) + 256 * byte(focas::PmcArea::f, 41), 1500);
  EXPECT_EQ(byte(focas::PmcArea::f, 45), 0x08);         // SAR
  EXPECT_EQ(byte(focas::PmcArea::g, 12), 0xff & ~100);  // *FV
  EXPECT_EQ(m.calls.data.writePmc(focas::PmcArea::g, 12, {0}), focas::EW_OK);
  EXPECT_EQ(byte(focas::PmcArea::g, 12), 0xff & ~100) << "overwritten by the PMC program";
  EXPECT_EQ(m.calls.data.writePmc(focas::PmcArea::d, 100, {1, 2}), focas::EW_OK);
  EXPECT_EQ(byte(focas::PmcArea::d, 101), 2);
  m.controller.emergency(true);
  EXPECT_EQ(byte(focas::PmcArea::x, 8) & 0x10, 0);
  focas::Bytes bytes;
  EXPECT_EQ(m.calls.data.readPmc(focas::PmcArea::d, 9999, 10000, &bytes), focas::EW_NUMBER);
}

TEST(Memory, ClockIsSetAndRuns) {
  ControllerOptions options = testOptions();
  std::int64_t now = 1000000000;  // 2001-09-09 01:46:40
  options.wall_clock = [&] { return now; };
  Machine m(options);
  EXPECT_EQ(m.calls.data.dateTime()->year, 2001);
  EXPECT_EQ(m.calls.data.dateTime()->second, 40);
  focas::DateTime at = *m.calls.data.dateTime();
  at.hour = 23;
  EXPECT_EQ(m.calls.data.setDateTime(at), focas::EW_OK);
  now += 3600;
  EXPECT_EQ(m.calls.data.dateTime()->day, 10);
  EXPECT_EQ(m.calls.data.dateTime()->hour, 0);
}

TEST(Memory, ParametersFollowTheMachine) {
  Machine m;
  EXPECT_EQ(m.calls.axes.servoLoopGain(), m.calls.data.parameters(1825, 1825).at(0).values);
  const std::vector<focas::NumberedValue> limits = m.calls.data.parameters(1320, 1321);
  ASSERT_EQ(limits.size(), 2u);
  EXPECT_EQ(limits[0].values, (std::vector<double>{250.0, 200.0, 0.0}));
  EXPECT_EQ(limits[1].values, (std::vector<double>{-250.0, -200.0, -300.0}));
  EXPECT_TRUE(m.calls.data.parameters(9999, 9999).empty());
  EXPECT_EQ(m.calls.data.diagnoses(445, 445).size(), 1u);
}

// First-order heating: after one time constant 1 - 1/e of the steady rise (closed form).
TEST(Load, MotorsHeatWithTheirLoad) {
  ControllerOptions options = testOptions();
  options.motor_temperature = 20.0;
  options.motor_load_rise = 40.0;
  options.motor_time_constant = 10.0;
  Machine m(options);
  const auto reported = [&](int number) { return m.calls.data.diagnoses(number, number).at(0).values; };
  m.controller.setServoLoad({100.0, 50.0, 0.0});
  m.controller.setSpindleLoad(200.0);
  m.run(10.0);
  const double grown = 1.0 - std::exp(-1.0);
  EXPECT_NEAR(reported(308)[0], 20.0 + 40.0 * grown, 0.6);  // reported as integers
  EXPECT_NEAR(reported(309)[1], 20.0 + 10.0 * grown, 0.6);
  EXPECT_EQ(reported(308)[2], 20.0);
  EXPECT_NEAR(reported(403)[0], 20.0 + 160.0 * grown, 0.6);
  m.controller.setServoLoad({0.0, 0.0, 0.0});
  m.run(100.0);
  EXPECT_EQ(reported(308)[0], 20.0);
}

TEST(Load, PolledLoadsAreRoundedToTheControllersStep) {
  ControllerOptions options = testOptions();
  options.load_step = 100.0 * 3.0e-4 / 8.0;  // 0.3 mV of 8 V
  Machine m(options);
  for (const double volt : {0.0, 1e-4, 2e-4, 0.12345, 3.1}) {
    m.controller.setSpindleLoad(100.0 * volt / 8.0);
    const double read = m.calls.axes.spindleLoad()[0] * 8.0 / 100.0;
    EXPECT_NEAR(read, 3.0e-4 * std::round(volt / 3.0e-4), 1e-12);
  }
}

TEST(Collision, CollisionWithAnObstacleStopsWithAnAlarm) {
  MachineModel model;
  model.tool.emplace();
  model.tool->diameter = 0.02;
  model.hammer.emplace();
  model.hammer->gap_at_zero_volt = 250e-6;
  model.hammer->offset = 15e-3;
  model.hammer->position["x"] = {0.1, 0.0, -0.12};
  model.workpiece.emplace();
  model.workpiece->low = {-0.14, -0.08, -0.2};
  ControllerOptions options = testOptions();
  options.watches = {std::make_shared<CollisionWatch>(CollisionWatch::ofModel(model))};
  const struct {
    const char* text;
    const char* met;
  } cases[] = {{"G90 G0 X100\nG1 Z-120 F3000\nX102 F300\n", "SENSOR x"},
               {"G90 G0 X50\nZ-110\nX150\n", "HAMMER x"},
               {"G90 G0 X150\nZ-150\n", "HAMMER x"},
               {"G90 G0 X-100 Y-100\nZ-201\n", "TABLE"},
               {"G90 G0 X100\nG1 Z-120 F3000\nG91 X0.2 F300\nZ50\nG0 X0\n", nullptr}};
  for (const auto& c : cases) {
    Machine m(options);
    m.start(c.text);
    m.runToEnd();
    EXPECT_EQ(m.alarmText(), c.met != nullptr ? std::string("TOOL MET ") + c.met : "") << c.text;
    if (c.met != nullptr) {
      EXPECT_EQ(m.calls.dnc.dncAbort(), focas::EW_ALARM);
      m.run(1.0);
      EXPECT_EQ(m.controller.motion().velocity, (std::array<double, 3>{0, 0, 0}));
    }
  }
}

// At rest the space between two flutes permits a closer position, in which the spindle must not turn.
TEST(Collision, SpindleMustNotTurnWhereOnlyTheCoreFits) {
  ControllerOptions options = testOptions();
  CollisionWatch obstacles;
  obstacles.tool_radius = 0.010;
  obstacles.core_radius = 0.009;
  obstacles.add({"SENSOR", {0.02, -0.005, -1.0}, {0.08, 0.005, 1.0}});
  options.watches = {std::make_shared<CollisionWatch>(obstacles)};
  Machine m(options);
  m.start("G1 X10.5 F600\n");
  m.runToEnd();
  EXPECT_EQ(m.alarmText(), "");
  m.send("#1133=2048\nM119\n");
  m.run(0.1);
  EXPECT_EQ(m.alarmText(), "TOOL MET SENSOR");
}

// A fault of an axis is one class, which the control does not depend on.
TEST(MotionWatch, FaultOfAnAxisStopsTheMachine) {
  struct ZAxisFault : MotionWatch {
    std::optional<focas::AlarmMessage> check(const MotionState& state) const override {
      if (state.position[2] > -0.05) return std::nullopt;
      return focas::AlarmMessage{410, 6, 3, "SERVO ALARM: Z AXIS"};
    }
  };
  ControllerOptions options = testOptions();
  options.watches = {std::make_shared<ZAxisFault>()};
  Machine m(options);
  m.start("G91 G1 X10 F6000\nZ-100\n");
  m.run(5.0);
  EXPECT_EQ(m.alarmText(), "SERVO ALARM: Z AXIS");
  EXPECT_EQ(m.calls.state.alarmBits(), 1U << 6);
  // 0.1 m/s: at most one period of the check beyond the limit, and 2.5 mm of braking at 2 m/s2.
  EXPECT_NEAR(m.controller.motion().position[2], -0.0525, 0.1 * 3.0 * DT);
  EXPECT_EQ(m.controller.motion().velocity, (std::array<double, 3>{0, 0, 0}));
}

TEST(ServoGuide, CurrentsLoadAndTriggerAtABlock) {
  Machine m;
  ServoRecorder recorder(20);
  m.start("N10 G91 G1 X60 F6000\nN20 X-60\n");
  const double dt = 1.0 / 25600.0;
  m.run(2.5, dt);
  double time = 0.0;
  for (const MotionState& state : m.states) {
    recorder.push({time, state, 0.25, {0.0, 0.0, 0.0}});
    time += dt;
  }
  const SampleBlock block = recorder.take();
  EXPECT_EQ(block.sample_rate, 1000.0);
  ASSERT_EQ(block.samples.size(), 9u * 2500u);
  const auto at = [&](std::size_t k, std::size_t channel) { return block.samples[9 * k + channel]; };
  const AxisDrive drive;
  // At 0.1 m/s friction alone; during the acceleration of 2 m/s2 the mass as well.
  const double friction = (drive.viscous * 0.1 + drive.coulomb) / drive.force_per_ampere;
  EXPECT_NEAR(at(300, 1), friction, 1e-9);
  EXPECT_NEAR(at(25, 1), (drive.mass * 2.0 + drive.viscous * 0.05 + drive.coulomb) / drive.force_per_ampere,
              0.01);
  EXPECT_EQ(at(300, 0), 0.25);
  EXPECT_NEAR(at(300, 4), 0.1, 1e-9);  // velocity along x
  EXPECT_EQ(at(300, 5), 0.0);
  EXPECT_EQ(at(300, 7), 10.0);
  EXPECT_EQ(at(300, 8), 0.0);
  // The second block begins after 0.6 s + 0.05 s.
  EXPECT_EQ(at(649, 8), 0.0);
  EXPECT_EQ(at(651, 8), 1.0);
  EXPECT_EQ(at(2400, 8), 1.0);
  EXPECT_EQ(at(900, 7), 20.0);
}

}  // namespace
}  // namespace smartmill::sim
