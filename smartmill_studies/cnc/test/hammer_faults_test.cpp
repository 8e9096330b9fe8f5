// Complete measurement of the automatic hammer through bridge and network. At each step the controller's
// server is killed and restarted: the measurement ends with a message, nothing moves without a command, and
// the tool can be retracted after the machine is armed again.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <tuple>
#include <utility>
#include <vector>

#include "smartmill_cnc/bridge.h"
#include "smartmill_cnc/controller/focas_controller.h"
#include "smartmill_focas/server.h"
#include "smartmill_hammer/sequence/hammer_sequence.h"
#include "smartmill_sim/world/world.h"

namespace smartmill {
namespace {

constexpr double BLOCK_TIME = sim::World::BLOCK / sim::World::SAMPLE_RATE;  // [s]
constexpr double MOST_TIME = 240.0;                                         // [s] of a measurement

/// The logic of hammer_node and cnc_node without topics and actions.
class Rig {
 public:
  explicit Rig(const MachineModel& model) : world_(model, worldOptions()), sequence_({}, model) {
    startServer(0);
    cnc::FocasParameters focas;
    focas.port = port_;
    focas.reply_timeout = 10.0;
    cnc::MotionParameters motion;
    motion.read_only = false;
    motion.limits.travel = model.axes->travel;
    motion.limits.max_feed = model.axes->rapid;
    motion.limits.max_spindle_speed = model.spindle->max_speed.value_or(2000.0);
    bridge_ = std::make_unique<cnc::Bridge>(cnc::makeFocasController(focas), 0.5, motion);
    step();
  }

  void startServer(std::uint16_t port) {
    focas::ServerOptions options;
    options.port = port;
    server_ = std::make_unique<focas::Server>(options, world_.controller().calls());
    port_ = server_->port();
  }
  void startServer() { startServer(port_); }
  void killServer() { server_.reset(); }

  void begin() {
    MeasureFrfGoal goal;
    goal.tool = "mill";
    goal.point = POINT_TOOL_TIP;
    goal.direction = "x";
    goal.hits = 2;
    goal.modes = 1;
    goal.stamp = time_;
    sequence_.handle(goal);
  }

  /// One period of the bridge.
  void step() {
    bridge_->fetch(time_);
    bridge_->step(time_);
    if (bridge_->busy()) {
      // Program text is transferred while the simulated time is stopped.
      std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
    sequence_.handle(bridge_->state());
    for (int i = 0; i < 2; ++i) {
      sim::World::Block block;
      world_.advance(block);
      time_ += BLOCK_TIME;
      sequence_.handle(block.hammer);
      for (const SpindleAngle& angle : block.angle) {
        sequence_.handle(angle);
      }
      obey();
    }
    if (const auto feedback = sequence_.takeFeedback()) {
      stage_ = feedback->stage;
    }
    if (const auto result = sequence_.takeResult()) {
      result_ = result;
    }
  }
  void steps(double seconds) {
    for (const double end = time_ + seconds; time_ < end;) {
      step();
    }
  }

  /// Runs until the sequence reports a step. @return false if it ended before
  bool reach(const std::string& stage) {
    for (const double end = time_ + MOST_TIME; time_ < end && !result_; step()) {
      if (stage_.rfind(stage, 0) == 0) {
        return true;
      }
    }
    return false;
  }
  std::optional<hammer::MeasureFrfResult> finish() {
    for (const double end = time_ + MOST_TIME; time_ < end && !result_;) {
      step();
    }
    return result_;
  }
  std::optional<cnc::Outcome> program(const std::string& text) {
    outcome_ = bridge_->runProgram("by hand", text, {});
    for (const double end = time_ + MOST_TIME; time_ < end && !outcome_;) {
      step();
    }
    return outcome_;
  }

  std::string ended() const { return result_ ? result_->message : "no result"; }
  cnc::Bridge& bridge() { return *bridge_; }
  sim::MotionState motion() { return world_.controller().motion(); }
  std::vector<focas::AlarmMessage> alarms() { return world_.controller().calls().state.alarmMessages(); }
  int blocks() { return world_.controller().calls().state.blockCount(); }

 private:
  static sim::WorldOptions worldOptions() {
    sim::WorldOptions options;
    options.substeps = 1;
    return options;
  }

  /// As in hammer_node: one motion at a time; a stop cancels the running and the queued motion.
  void obey() {
    using Kind = hammer::Command::Kind;
    if (const std::optional<cnc::Outcome> outcome = bridge_->takeOutcome()) {
      outcome_ = outcome;
      if (outcome->code != cnc::MotionCode::ok && !std::exchange(stopping_, false)) {
        sequence_.commandFailed(time_, outcome->message);
      }
    }
    for (const hammer::Command& command : sequence_.takeCommands()) {
      std::string message;
      if (command.kind == Kind::strike) {
        if (world_.strike("tool", command.direction, message) != sim::World::StrikeAnswer::ok) {
          sequence_.commandFailed(time_, message);
        }
      } else if (command.kind == Kind::stop) {
        waiting_.clear();
        stopping_ = bridge_->busy();
        bridge_->cancel();
      } else {
        waiting_.push_back(command);
      }
    }
    if (!waiting_.empty() && !bridge_->busy()) {
      const hammer::Command command = waiting_.front();
      waiting_.pop_front();
      stopping_ = false;
      const std::optional<cnc::Outcome> refused =
          command.kind == Kind::orient ? bridge_->orient(command.angle)
          : command.kind == Kind::jog
              ? bridge_->jog(command.axis, command.distance, command.feed)
              : bridge_->runProgram("hammer station", hammer::moveProgram(command.from, command.path), {});
      if (refused) {
        sequence_.commandFailed(time_, refused->message);
      }
    }
  }

  sim::World world_;
  hammer::HammerSequence sequence_;
  std::unique_ptr<focas::Server> server_;
  std::uint16_t port_ = 0;
  std::unique_ptr<cnc::Bridge> bridge_;
  double time_ = 0.0;  // [s]
  std::deque<hammer::Command> waiting_;
  bool stopping_ = false;
  std::string stage_;
  std::optional<cnc::Outcome> outcome_;  // of the last motion
  std::optional<hammer::MeasureFrfResult> result_;
};

/// Tests run in their folder.
MachineModel model() {
  return readMachineModel("../../launch/models/mill_twin.yaml");
}

/// A step by its progress text, and the delay of the fault after it [s].
class HammerFaults : public ::testing::TestWithParam<std::tuple<const char*, double>> {};

TEST_P(HammerFaults, AServerKilledAndRestartedEndsTheMeasurementAndMovesNothing) {
  Rig rig(model());
  ASSERT_TRUE(rig.bridge().state().connected);
  const cnc::Answer<cnc::ArmCode> armed = rig.bridge().arm(true);
  ASSERT_EQ(armed.code, cnc::ArmCode::ok) << armed.message;
  rig.begin();
  ASSERT_TRUE(rig.reach(std::get<0>(GetParam()))) << rig.ended();
  rig.steps(std::get<1>(GetParam()));
  rig.killServer();
  rig.steps(0.5);
  EXPECT_FALSE(rig.bridge().state().connected || rig.bridge().state().armed);
  // The motion in progress has stopped; further commands of the sequence do not reach the machine.
  const sim::MotionState stood = rig.motion();
  const int blocks = rig.blocks();
  rig.startServer();
  const std::optional<hammer::MeasureFrfResult> result = rig.finish();
  ASSERT_TRUE(result);
  EXPECT_EQ(result->code, FrfCode::motion_failed) << result->message;
  EXPECT_NE(result->message.find("connection"), std::string::npos) << result->message;
  EXPECT_EQ(result->message.find('\n'), std::string::npos) << result->message;
  rig.steps(3.0);
  EXPECT_EQ(rig.motion().position, stood.position) << result->message;
  EXPECT_EQ(rig.motion().spindle_speed, 0.0);
  EXPECT_EQ(rig.blocks(), blocks);
  EXPECT_TRUE(rig.alarms().empty());
  // The controller is back, disarmed; the operator retracts the tool.
  EXPECT_TRUE(rig.bridge().state().connected);
  EXPECT_FALSE(rig.bridge().state().armed);
  EXPECT_EQ(rig.bridge().jog("z", 1e-3, 1e-3)->code, cnc::MotionCode::not_armed);
  ASSERT_EQ(rig.bridge().arm(true).code, cnc::ArmCode::ok);
  const int up = static_cast<int>(std::floor(-1e3 * stood.position[2]));  // [mm] to the end of the travel
  const std::optional<cnc::Outcome> retracted = rig.program("G91 G0 Z" + std::to_string(up) + "\n");
  ASSERT_TRUE(retracted);
  EXPECT_EQ(retracted->code, cnc::MotionCode::ok) << retracted->message;
}

INSTANTIATE_TEST_SUITE_P(
    Steps, HammerFaults,
    ::testing::Combine(::testing::Values("stopping and orienting", "moving to the hammer station",
                                         "searching a flute at the tip", "lowering the tool",
                                         "searching the flute halfway", "flute at", "turning the flute",
                                         "calibrating the displacement sensor", "sensor calibrated",
                                         "hit 1 of 2", "retracting"),
                       ::testing::Values(0.0, 0.08)));

}  // namespace
}  // namespace smartmill
