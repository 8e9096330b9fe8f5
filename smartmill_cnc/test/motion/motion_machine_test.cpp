// The motion machine with a scripted controller: every end of a motion in every phase.
#include "smartmill_cnc/motion/motion_machine.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "../scripted_controller.h"
#include "smartmill_core/error.h"

namespace smartmill::cnc {
namespace {

constexpr double PERIOD = 0.02;  // [s]

MotionParameters someParameters() {
  MotionParameters p;
  p.read_only = false;
  p.limits.travel = {{{-0.2, 0.2}, {-0.2, 0.2}, {-0.2, 0.2}}};
  p.limits.max_feed = 0.5;
  p.limits.max_spindle_speed = 1000.0;
  return p;
}

const Failure LOST{Failure::Kind::lost, "the wire is cut"};
const Failure ALARM{Failure::Kind::alarm, "overtravel"};
const Failure NOT_YET{Failure::Kind::not_yet, "not now"};
const Failure REFUSED{Failure::Kind::refused, "no"};

class MotionMachineTest : public ::testing::Test {
 protected:
  MotionMachineTest() : machine_(controller_, someParameters(), log_) { controller_.is_connected = true; }

  Status step() {
    now_ += PERIOD;
    return machine_.step(controller_.reading, now_);
  }
  void arm() {
    ASSERT_TRUE(step());
    const Result<Answer<ArmCode>> answer = machine_.arm();
    ASSERT_TRUE(answer);
    ASSERT_EQ(answer->code, ArmCode::ok) << answer->message;
  }
  // Starts a jog and advances it to a phase. @param stage its name
  void bring(const std::string& stage) {
    arm();
    controller_.reading.program_done = false;
    controller_.taken_at_once = stage == "sending" ? 1 : 1000;
    ASSERT_FALSE(machine_.jog("x", 0.05, 0.01));
    if (stage != "opening") {
      ASSERT_TRUE(step());
    }
    if (stage == "stopping") {
      controller_.reading.at_rest = false;
      ASSERT_TRUE(machine_.cancel());
    }
    ASSERT_EQ(machine_.progress().stage, stage);
  }
  Outcome outcome() {
    const std::optional<Outcome> outcome = machine_.takeOutcome();
    EXPECT_TRUE(outcome);
    EXPECT_FALSE(machine_.busy());
    return outcome.value_or(Outcome{MotionCode::busy, "none"});
  }
  double stepsUntilEnd(int most) {
    const double from = now_;
    for (int i = 0; i < most && machine_.busy(); ++i) {
      EXPECT_TRUE(step());
    }
    return now_ - from;
  }

  ScriptedController controller_;
  Log log_;
  MotionMachine machine_;
  double now_ = 50.0;  // [s]
};

class MotionPhaseTest : public MotionMachineTest, public ::testing::WithParamInterface<const char*> {};
INSTANTIATE_TEST_SUITE_P(Every, MotionPhaseTest,
                         ::testing::Values("opening", "sending", "running", "stopping"),
                         [](const auto& test) { return std::string(test.param); });

TEST_P(MotionPhaseTest, LostConnectionEndsTheMotion) {
  bring(GetParam());
  controller_.is_connected = controller_.is_open = false;
  EXPECT_EQ(machine_.lost("the wire is cut", now_ + PERIOD), "jog x: the wire is cut");
  EXPECT_EQ(outcome().code, MotionCode::lost);
  EXPECT_FALSE(machine_.armed());
  EXPECT_EQ(machine_.jog("x", 0.01, 0.0)->code, MotionCode::not_connected);
}

TEST_P(MotionPhaseTest, AlarmEndsTheMotionAndDisarms) {
  bring(GetParam());
  controller_.reading.state.alarm = true;
  controller_.reading.state.alarm_text = "430 X AXIS OVERHEAT";
  ASSERT_TRUE(step());
  const Outcome end = outcome();
  EXPECT_EQ(end.code, MotionCode::alarm);
  EXPECT_EQ(end.message, "jog x: alarm: 430 X AXIS OVERHEAT");
  EXPECT_FALSE(machine_.armed());
  EXPECT_FALSE(controller_.is_open);
}

TEST_P(MotionPhaseTest, AnotherModeEndsTheMotionAndDisarms) {
  bring(GetParam());
  controller_.reading.state.mode = CncMode::jog;
  ASSERT_TRUE(step());
  EXPECT_EQ(outcome().code, MotionCode::wrong_mode);
  EXPECT_FALSE(machine_.armed());
}

TEST_P(MotionPhaseTest, CancelEndsTheMotionOnce) {
  const std::string stage = GetParam();
  bring(stage);
  ASSERT_TRUE(machine_.cancel());
  controller_.reading.at_rest = true;
  stepsUntilEnd(10);
  const Outcome end = outcome();
  EXPECT_EQ(end.code, MotionCode::cancelled);
  EXPECT_EQ(end.message, stage == "opening" ? "jog x: cancelled before anything was sent"
                                            : "jog x: cancelled; stopped at X0.000 Y0.000 Z0.000 mm");
  // Nothing was sent yet, so nothing is aborted.
  EXPECT_EQ(controller_.count("abort"), stage == "opening" ? 0u : 1u);
  EXPECT_TRUE(machine_.armed());
  // The next motion opens a new session and works.
  controller_.reading.program_done = true;
  controller_.taken_at_once = 1000;
  ASSERT_FALSE(machine_.jog("x", 0.01, 0.01));
  stepsUntilEnd(20);
  EXPECT_EQ(outcome().code, MotionCode::ok);
}

TEST_P(MotionPhaseTest, DisarmCancelsAndLeavesNoSession) {
  bring(GetParam());
  ASSERT_TRUE(machine_.disarm());
  EXPECT_FALSE(machine_.armed());
  EXPECT_FALSE(controller_.is_open);
  controller_.reading.at_rest = true;
  stepsUntilEnd(10);
  EXPECT_EQ(outcome().code, MotionCode::cancelled);
}

TEST_F(MotionMachineTest, LossDuringACallIsReturnedToTheCaller) {
  bring("opening");
  controller_.is_open = false;
  controller_.opening = LOST;
  EXPECT_TRUE(step().lost());
  machine_.lost("the wire is cut", now_);
  EXPECT_EQ(outcome().code, MotionCode::lost);
  controller_.opening.reset();
  controller_.is_connected = true;
  bring("sending");
  controller_.sending = LOST;
  EXPECT_TRUE(step().lost());
  machine_.lost("the wire is cut", now_);
  controller_.sending.reset();
  controller_.is_connected = true;
  bring("running");
  controller_.aborting = LOST;
  EXPECT_TRUE(machine_.cancel().lost());
}

TEST_F(MotionMachineTest, RetriesWhileTheControllerDelaysPrograms) {
  bring("opening");
  controller_.is_open = false;
  controller_.opening = NOT_YET;
  const double waited = stepsUntilEnd(1000);
  EXPECT_NEAR(waited, MotionParameters().open_timeout, 2.0 * PERIOD);
  EXPECT_EQ(outcome().message, "jog x: not now");
  // The controller accepts within the timeout.
  ASSERT_FALSE(machine_.jog("x", 0.05, 0.01));
  ASSERT_TRUE(step());
  controller_.opening.reset();
  controller_.reading.program_done = true;
  stepsUntilEnd(20);
  EXPECT_EQ(outcome().code, MotionCode::ok);
  // Any other refusal is not retried.
  controller_.is_open = false;
  controller_.opening = ALARM;
  ASSERT_FALSE(machine_.jog("x", 0.05, 0.01));
  ASSERT_TRUE(step());
  EXPECT_EQ(outcome().code, MotionCode::alarm);
}

TEST_F(MotionMachineTest, FailureInTheStreamGivesUpAndDisarms) {
  bring("sending");
  controller_.sending = REFUSED;
  ASSERT_TRUE(step());
  EXPECT_EQ(outcome().message, "jog x: no");
  EXPECT_FALSE(machine_.armed());
  controller_.sending.reset();
  bring("running");
  controller_.checking = Failure{Failure::Kind::refused, "the controller was reset"};
  ASSERT_TRUE(step());
  EXPECT_EQ(outcome().code, MotionCode::cancelled);
  EXPECT_FALSE(machine_.armed());
}

TEST_F(MotionMachineTest, EndsOnlyWhenDoneAtRestAndSettled) {
  bring("running");
  for (int i = 0; i < 20; ++i) {
    ASSERT_TRUE(step());
  }
  EXPECT_TRUE(machine_.busy());
  controller_.reading.program_done = true;
  controller_.reading.state.distance_to_go[0] = 0.001;
  for (int i = 0; i < 20; ++i) {
    ASSERT_TRUE(step());
  }
  EXPECT_TRUE(machine_.busy());
  EXPECT_EQ(machine_.progress().distance_to_go, 0.001);
  controller_.reading.state.distance_to_go[0] = 0.0;
  const double settled = stepsUntilEnd(100);
  EXPECT_NEAR(settled, MotionParameters().settle_time + PERIOD, PERIOD);
  EXPECT_EQ(outcome().code, MotionCode::ok);
}

TEST_F(MotionMachineTest, OrientWaitsForStandstill) {
  arm();
  ASSERT_FALSE(machine_.orient(1.0));
  controller_.reading.program_done = true;
  controller_.reading.state.spindle_speed = 3.0;
  for (int i = 0; i < 50; ++i) {
    ASSERT_TRUE(step());
  }
  EXPECT_TRUE(machine_.busy());
  controller_.reading.state.spindle_speed = 0.1;
  stepsUntilEnd(20);
  EXPECT_EQ(outcome().code, MotionCode::ok);
}

TEST_F(MotionMachineTest, StallTimeoutStopsAndFeedHoldDoesNot) {
  bring("running");
  controller_.reading.state.run = CncRun::hold;
  for (double t = 0.0; t < 2.0 * MotionParameters().stall_timeout; t += PERIOD) {
    ASSERT_TRUE(step());
  }
  EXPECT_EQ(machine_.progress().stage, "running");
  controller_.reading.state.run = CncRun::start;
  const double waited = stepsUntilEnd(4000);
  EXPECT_NEAR(waited, MotionParameters().stall_timeout, 5.0 * PERIOD);
  EXPECT_EQ(controller_.count("abort"), 1u);
  EXPECT_NE(outcome().message.find("nothing has moved for 60 s"), std::string::npos);
}

TEST_F(MotionMachineTest, MotionAfterTheStopTimeoutIsReported) {
  bring("stopping");
  const double waited = stepsUntilEnd(1000);
  EXPECT_NEAR(waited, MotionParameters().stop_timeout, 2.0 * PERIOD);
  EXPECT_NE(outcome().message.find("STILL MOVES"), std::string::npos);
}

TEST_F(MotionMachineTest, ConditionIsAnnouncedInAdvanceAndEndsWithTheMotion) {
  arm();
  CuttingCondition cut;
  cut.kind = CuttingCondition::Kind::cut;
  cut.name = "slot";
  const double start = now_;
  ASSERT_FALSE(machine_.runProgram("slot", "G1 X10 F600\n", cut));
  ASSERT_TRUE(step());
  // Nothing is sent before its time.
  EXPECT_EQ(controller_.count("send"), 0u);
  std::vector<CuttingCondition> conditions = machine_.takeConditions();
  ASSERT_EQ(conditions.size(), 1u);
  EXPECT_NEAR(conditions[0].stamp, start + PERIOD + 0.3, 1e-9);
  while (controller_.count("send") == 0) {
    ASSERT_TRUE(step());
  }
  EXPECT_GE(now_, conditions[0].stamp);
  controller_.reading.program_done = true;
  stepsUntilEnd(100);
  conditions = machine_.takeConditions();
  ASSERT_EQ(conditions.size(), 1u);
  EXPECT_EQ(conditions[0].kind, CuttingCondition::Kind::none);
  EXPECT_LE(conditions[0].stamp, now_ + 1e-9);
}

TEST_F(MotionMachineTest, LimitsAxesAndGoalsAreCheckedBeforeAnythingIsSent) {
  EXPECT_EQ(machine_.jog("x", 0.01, 0.0)->code, MotionCode::not_connected);
  arm();
  EXPECT_EQ(machine_.jog("x", 0.3, 0.0)->code, MotionCode::limit);
  EXPECT_EQ(machine_.jog("w", 0.01, 0.0)->code, MotionCode::bad_goal);
  EXPECT_EQ(machine_.jog("", 0.01, 0.0)->code, MotionCode::bad_goal);
  EXPECT_EQ(machine_.jog("x", INFINITY, 0.0)->code, MotionCode::bad_goal);
  controller_.reading.state.axes = {"X", "Y", "B"};
  ASSERT_TRUE(step());
  EXPECT_EQ(machine_.jog("x", 0.01, 0.0)->message, "jog x: the controller has no axis Z");
  EXPECT_EQ(controller_.count("begin"), 0u);
}

}  // namespace
}  // namespace smartmill::cnc
