// The bridge with a real LinuxCNC, without display, in namespaces of its own. Skipped if LinuxCNC is not
// installed
// (./setup --with-linuxcnc) or if the namespaces cannot be created.

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

#include "smartmill_cnc/bridge.h"
#include "smartmill_cnc/linuxcnc/gateway_client.h"
#include "smartmill_cnc/linuxcnc/linuxcnc_controller.h"
#include "smartmill_core/error.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill::cnc::linuxcnc {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr double LATENCY = 0.5;       // [s] to detect a fault
constexpr double LATENCY_BUSY = 5.0;  // [s] the same if this program waits for a processor
constexpr double PATIENCE = 60.0;     // [s] for a busy computer

double now() {
  return std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
}

/// [s] LATENCY_BUSY on an overloaded computer.
double latency() {
  double load = 0.0;
  return ::getloadavg(&load, 1) == 1 && load > 2.0 * std::thread::hardware_concurrency() ? LATENCY_BUSY
                                                                                         : LATENCY;
}

void pause(double seconds) {
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
}

/// Occupies a processor at real-time priority. @return false without permission
bool occupy(int processor, double seconds) {
  bool permitted = false;
  std::thread([&] {
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(static_cast<unsigned>(processor), &one);
    const sched_param first{50};
    permitted =
        ::sched_setaffinity(0, sizeof one, &one) == 0 && ::sched_setscheduler(0, SCHED_FIFO, &first) == 0;
    for (const double end = now() + seconds; permitted && now() < end;) {
    }
  }).join();
  return permitted;
}

/// Processes whose command line contains both words.
std::vector<pid_t> processes(const std::string& word, const std::string& other) {
  std::vector<pid_t> found;
  for (const auto& entry : fs::directory_iterator("/proc")) {
    const std::string name = entry.path().filename();
    if (name.find_first_not_of("0123456789") != std::string::npos) {
      continue;
    }
    std::ifstream file(entry.path() / "cmdline");
    std::stringstream text;
    text << file.rdbuf();
    if (text.str().find(word) != std::string::npos && text.str().find(other) != std::string::npos) {
      found.push_back(static_cast<pid_t>(std::stol(name)));
    }
  }
  return found;
}

class LinuxCncMachine : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    if (!skipReason().empty()) {
      return;
    }
    folder_ = "/dev/shm/smartmill_test_" + std::to_string(::getpid());
    start();
  }
  static void TearDownTestSuite() { stop(); }

  void SetUp() override {
    const std::string why = skipReason();
    if (!why.empty()) {
      GTEST_SKIP() << why;
    }
    stream_ = std::make_shared<ServoStream>(folder_);
    MotionParameters motion;
    motion.read_only = false;
    motion.condition_lead = 0.0;
    motion.read_only = false;
    motion.limits.travel = {{{-0.25, 0.25}, {-0.2, 0.2}, {-0.3, 0.0}}};
    motion.limits.max_feed = 0.4;
    motion.limits.max_spindle_speed = 2100.0;
    bridge_ = std::make_unique<Bridge>(makeLinuxCncController({folder_, 20.0}, stream_, now), 0.1, motion);
    ready();
    ASSERT_TRUE(until([&] { return bridge_->state().connected; }));
    const Answer<ArmCode> armed = bridge_->arm(true);
    ASSERT_EQ(armed.code, ArmCode::ok) << armed.message;
  }

  static std::string skipReason() {
    if (::access("/usr/bin/linuxcnc", X_OK) != 0 || !fs::exists(program("linuxcnc_gateway"))) {
      return "LinuxCNC is not installed (./setup --with-linuxcnc)";
    }
    return ::geteuid() == 0 ? "" : "namespaces for a LinuxCNC of its own need root";
  }
  static std::string program(const std::string& name) {
    return fs::canonical("/proc/self/exe").parent_path().string() + "/" + name;
  }

  /// The working directory of tests is the package's folder.
  static void start() {
    static const TemporaryFolder in_tmp;  // which LinuxCNC replaces by one of its own
    const std::string model = in_tmp.file("mill.yaml");
    fs::copy_file("../launch/models/mill.yaml", model, fs::copy_options::overwrite_existing);
    machine_ = ::fork();
    if (machine_ == 0) {
      ::setsid();
      const int null = ::open("/dev/null", O_WRONLY);
      ::dup2(null, 2);
      ::setenv("SMARTMILL_CNC_BIN", fs::path(program("x")).parent_path().c_str(), 1);
      ::execl("scripts/linuxcnc_machine", "linuxcnc_machine", model.c_str(), folder_.c_str(), nullptr);
      ::_exit(127);
    }
  }
  static int stop() {
    if (machine_ <= 0) {
      return 0;
    }
    ::kill(machine_, SIGTERM);
    int status = 0;
    ::waitpid(std::exchange(machine_, 0), &status, 0);
    fs::remove_all(folder_);
    return status;
  }

  /// Makes the machine ready at its panel.
  static void ready() {
    const double end = now() + PATIENCE;
    for (std::string why = "not tried";; pause(0.05)) {
      try {
        GatewayClient panel(folder_, 20.0);
        panel.connect();
        const Reply reply = panel.carryOut({CommandCode::ready, 0, 0.0, {}});
        if (reply.code == Reply::Code::done) {
          return;
        }
        why = reply.text;
      } catch (const Error& e) {
        why = e.what();
      }
      ASSERT_LT(now(), end) << why;
    }
  }
  static Reply atPanel(CommandCode code) {
    GatewayClient panel(folder_, 20.0);
    panel.connect();
    return panel.carryOut({code, 0, 0.0, {}});
  }

  /// Runs periods of the bridge until the condition holds. @return false on a timeout
  bool until(const std::function<bool()>& condition, double seconds = PATIENCE) {
    for (const double end = now() + seconds; !condition();) {
      if (now() > end) {
        return false;
      }
      period();
    }
    return true;
  }
  void period() {
    for (ServoSegment& segment : stream_->step(0.005, now)) {
      for (const ServoSample& s : segment.samples) {
        samples_.push_back(s);
      }
    }
    bridge_->fetch(now());
    bridge_->step(now());
  }
  Outcome run(const std::string& text) {
    if (const std::optional<Outcome> refused = bridge_->runProgram("p", text, {})) {
      return *refused;
    }
    return outcome();
  }
  Outcome outcome() {
    std::optional<Outcome> ended;
    until([&] { return (ended = bridge_->takeOutcome()).has_value(); });
    return ended.value_or(Outcome{MotionCode::busy, "no outcome"});
  }
  /// Starts a slow feed along x with the spindle on.
  void cut() {
    ASSERT_EQ(run("G90 G0 X0 Y0 Z0\n").code, MotionCode::ok);
    ASSERT_FALSE(bridge_->runProgram("cut", "S3000 M3\nG1 F1200 X100\nX0\nM5\n", {}));
    ASSERT_TRUE(until([&] {
      return !samples_.empty() && samples_.back().position[0] > 5e-3 && samples_.back().velocity > 0.019;
    }));
  }
  /// [s] until the condition holds.
  double timeUntil(const std::function<bool()>& condition) {
    const double begin = now();
    EXPECT_TRUE(until(condition));
    const double seconds = now() - begin;
    RecordProperty("detected_after_ms", static_cast<int>(1e3 * seconds));
    return seconds;
  }
  /// Axes and spindle stop and stay stopped.
  void expectStandstill() {
    EXPECT_TRUE(
        until([&] { return samples_.back().velocity == 0.0 && samples_.back().spindle_speed == 0.0; }, 2.0));
    const ServoSample then = samples_.back();
    const std::size_t from = samples_.size();
    until([] { return false; }, 0.5);
    EXPECT_GT(samples_.size(), from);
    for (std::size_t i = from; i < samples_.size(); ++i) {
      ASSERT_EQ(samples_[i].position, then.position);
      ASSERT_EQ(samples_[i].revolutions, then.revolutions);
    }
  }

  static std::string folder_;
  static pid_t machine_;
  std::shared_ptr<ServoStream> stream_;
  std::unique_ptr<Bridge> bridge_;
  std::vector<ServoSample> samples_;
};

std::string LinuxCncMachine::folder_;
pid_t LinuxCncMachine::machine_ = 0;

TEST_F(LinuxCncMachine, RunsAProgramWhoseMovesAreMarkedInTheStream) {
  ASSERT_EQ(run("G90 G0 X0 Y0 Z-10\n").code, MotionCode::ok);
  until([] { return false; }, 0.1);
  samples_.clear();
  const Outcome outcome = run("S6000 M3\nG4 P700\nG1 F1200 X12.3456\nG1 F600 Y-5\nM30\n");
  ASSERT_EQ(outcome.code, MotionCode::ok) << outcome.message;
  EXPECT_NEAR(bridge_->state().position[0], 12.3456e-3, 1e-9);
  EXPECT_NEAR(bridge_->state().position[1], -5e-3, 1e-9);
  EXPECT_EQ(bridge_->state().spindle_speed, 0.0);  // M30 waits for the spindle, as on a Fanuc

  std::size_t first = 0, second = 0, unmarked = 0;
  for (std::size_t i = 1; i < samples_.size(); ++i) {
    const ServoSample &a = samples_[i - 1], &b = samples_[i];
    // The angle is the integral of the speed over the servo period.
    ASSERT_NEAR(b.revolutions - a.revolutions, b.spindle_speed / units::TWO_PI * 1e-3, 1e-9);
    // Line 4 of the text (G90 before the program's first) is the move along x, line 5 the one along y.
    // How long the marker stays after the move depends on when the controller's task runs again, so only
    // moving samples count.
    const bool x_moves = b.position[0] != a.position[0], y_moves = b.position[1] != a.position[1];
    first += x_moves && b.marker == 4.0 ? 1 : 0;
    second += y_moves && b.marker == 5.0 ? 1 : 0;
    unmarked += x_moves && b.marker != 4.0 ? 1 : 0;
    unmarked += y_moves && b.marker != 5.0 ? 1 : 0;
  }
  // The marker leads by the interpolation cycles of the controller.
  EXPECT_LE(unmarked, 6u);
  // 12.3456 mm at 20 mm/s and 5 mm at 10 mm/s, with 5 m/s2 at both ends.
  EXPECT_NEAR(static_cast<double>(first), 617.3 + 4.0, 6.0);
  EXPECT_NEAR(static_cast<double>(second), 500.0 + 2.0, 6.0);
  EXPECT_EQ(stream_->statistics().lost, 0u);
}

TEST_F(LinuxCncMachine, TurnsTheSpindleToAnAngleAndHoldsIt) {
  for (const double angle : {1.0, 5.5}) {
    ASSERT_FALSE(bridge_->orient(angle));
    ASSERT_EQ(outcome().code, MotionCode::ok);
    until([] { return false; }, 0.05);
    const double turns = samples_.back().revolutions;
    // Steps of 1/4096 revolution, and the controller's tolerance of 0.02 deg.
    EXPECT_NEAR(std::remainder(units::TWO_PI * turns - angle, units::TWO_PI), 0.0, 0.0008 + 0.0004);
    EXPECT_EQ(samples_.back().spindle_speed, 0.0);
  }
}

TEST_F(LinuxCncMachine, NothingBeyondALimitMoves) {
  ASSERT_EQ(run("G90 G0 X0 Y0 Z0\n").code, MotionCode::ok);
  EXPECT_EQ(run("G1 F600 X251\n").code, MotionCode::limit);
  // Sent past the bridge, the controller refuses it itself; the panel has to reset the error.
  GatewayClient other(folder_, 20.0);
  other.connect();
  ASSERT_EQ(other.carryOut({CommandCode::run, 77, 0.0, "G1 F600 X251\n"}).code, Reply::Code::done);
  EXPECT_LT(timeUntil([&] { return bridge_->state().alarm; }), latency());
  EXPECT_NE(bridge_->state().alarm_text.find("limit"), std::string::npos) << bridge_->state().alarm_text;
  EXPECT_FALSE(bridge_->state().armed);
  EXPECT_EQ(bridge_->state().position[0], 0.0);
  EXPECT_EQ(bridge_->arm(true).code, ArmCode::alarm);
}

TEST_F(LinuxCncMachine, FeedHoldStopsAndResumesAtTheSamePosition) {
  cut();
  const Answer<HoldCode> answer = bridge_->hold();
  ASSERT_EQ(answer.code, HoldCode::ok) << answer.message;
  EXPECT_LT(timeUntil([&] { return bridge_->state().run == CncRun::hold; }), latency());
  ASSERT_TRUE(until([&] { return samples_.back().velocity == 0.0; }, latency()));
  until([] { return false; }, 0.05);  // the position lags the planner's velocity by a servo period
  const std::array<double, 3> held = samples_.back().position;
  until([] { return false; }, 0.3);
  EXPECT_EQ(samples_.back().position, held);
  EXPECT_NEAR(samples_.back().spindle_speed, units::radPerSecFromRpm(3000.0), 1e-6);  // it keeps turning
  EXPECT_TRUE(bridge_->busy());
  ASSERT_EQ(atPanel(CommandCode::resume).code, Reply::Code::done);
  EXPECT_TRUE(until([&] { return samples_.back().position[0] > held[0] + 1e-3; }, 2.0));
  bridge_->cancel();
  EXPECT_EQ(outcome().code, MotionCode::cancelled);
}

TEST_F(LinuxCncMachine, OverridesActAtOnceAndEndWithTheProgram) {
  cut();
  const OverrideAnswer answer = bridge_->setOverrides({0.5, 0.9}, "chatter");
  ASSERT_EQ(answer.code, OverrideCode::ok) << answer.message;
  EXPECT_EQ(answer.taken.feed, 0.5);
  EXPECT_TRUE(until(
      [&] {
        const ServoSample& s = samples_.back();
        return std::abs(s.velocity - 0.010) < 1e-5 &&
               std::abs(s.spindle_speed - units::radPerSecFromRpm(2700.0)) < 1e-3;
      },
      5.0));
  // motion.adaptive-feed is at most 1.
  EXPECT_EQ(bridge_->setOverrides({1.1, 1.1}, "").taken.feed, 1.0);
  EXPECT_TRUE(until(
      [&] {
        const ServoSample& s = samples_.back();
        return std::abs(s.velocity - 0.020) < 1e-5 &&
               std::abs(s.spindle_speed - units::radPerSecFromRpm(3300.0)) < 1e-3;
      },
      5.0));
  EXPECT_EQ(bridge_->setOverrides({0.01, 1.0}, "").code, OverrideCode::limit);
  bridge_->cancel();
  EXPECT_EQ(outcome().code, MotionCode::cancelled);
  ASSERT_EQ(run("S3000 M3\nG4 P700\n").code, MotionCode::ok);
  EXPECT_NEAR(samples_.back().spindle_speed, units::radPerSecFromRpm(3000.0), 1e-3);
}

TEST_F(LinuxCncMachine, AnAbortStopsAxesAndSpindleAndTheNextProgramRuns) {
  cut();
  bridge_->cancel();
  const double begin = now();
  EXPECT_EQ(outcome().code, MotionCode::cancelled);
  EXPECT_LT(now() - begin, latency());
  expectStandstill();
  EXPECT_TRUE(bridge_->state().armed);
  const Outcome next = run("G90 G0 X0\n");
  EXPECT_EQ(next.code, MotionCode::ok) << next.message;
}

TEST_F(LinuxCncMachine, AnEmergencyStopDisarmsUntilThePanelIsReady) {
  cut();
  ASSERT_EQ(atPanel(CommandCode::estop).code, Reply::Code::done);
  EXPECT_LT(timeUntil([&] { return bridge_->state().emergency && !bridge_->state().armed; }), latency());
  EXPECT_EQ(outcome().code, MotionCode::alarm);
  expectStandstill();
  EXPECT_EQ(bridge_->arm(true).code, ArmCode::alarm);
  ready();
  until([] { return false; }, 0.1);
  EXPECT_FALSE(bridge_->state().armed);
  const Answer<ArmCode> again = bridge_->arm(true);
  ASSERT_EQ(again.code, ArmCode::ok) << again.message;
  const Outcome next = run("G90 G0 X0\n");
  EXPECT_EQ(next.code, MotionCode::ok) << next.message;
}

TEST_F(LinuxCncMachine, WithoutItsGatewayTheMachineStops) {
  cut();
  const std::vector<pid_t> gateway = processes("linuxcnc_gateway", folder_);
  ASSERT_EQ(gateway.size(), 1u);
  ::kill(gateway.front(), SIGKILL);
  EXPECT_LT(timeUntil([&] { return !bridge_->state().connected; }), latency());
  EXPECT_EQ(outcome().code, MotionCode::lost);
  expectStandstill();
  // The gateway restarts automatically; the machine stays stopped.
  ASSERT_TRUE(until([&] { return bridge_->state().connected; }));
  EXPECT_TRUE(bridge_->state().emergency || bridge_->state().alarm);
  ready();
  until([] { return false; }, 0.1);
  const Answer<ArmCode> again = bridge_->arm(true);
  ASSERT_EQ(again.code, ArmCode::ok) << again.message;
  const Outcome next = run("G90 G0 X0\n");
  EXPECT_EQ(next.code, MotionCode::ok) << next.message;
}

TEST_F(LinuxCncMachine, WithoutItsBridgeTheMachineStops) {
  cut();
  bridge_.reset();
  GatewayClient other(folder_, 20.0);
  other.connect();
  const double begin = now();
  while ((other.status().busy || !other.status().in_position) && now() < begin + PATIENCE) {
    pause(0.01);
  }
  EXPECT_LT(now() - begin, latency());
}

TEST_F(LinuxCncMachine, WithoutItsStreamTheMachineStops) {
  cut();
  const std::vector<pid_t> stream = processes("linuxcnc_stream", folder_);
  ASSERT_EQ(stream.size(), 1u);
  ::kill(stream.front(), SIGKILL);
  // Its beat stops, which opens the emergency stop chain.
  EXPECT_LT(timeUntil([&] { return !bridge_->state().armed; }), latency());
  const MotionCode code = outcome().code;
  EXPECT_TRUE(code == MotionCode::alarm || code == MotionCode::lost);
  ASSERT_TRUE(until([&] { return bridge_->state().connected; }));
  EXPECT_TRUE(bridge_->state().emergency || bridge_->state().alarm);
  expectStandstill();
}

TEST_F(LinuxCncMachine, AControllerThatWaitsForAProcessorIsNotLost) {
  if (std::thread::hardware_concurrency() < 2) {
    GTEST_SKIP() << "needs one processor for the controller and one for its gateway";
  }
  const std::vector<pid_t> gateway = processes("linuxcnc_gateway", folder_);
  ASSERT_EQ(gateway.size(), 1u);
  const auto namespaceOf = [](pid_t pid) {
    return fs::read_symlink("/proc/" + std::to_string(pid) + "/ns/pid");
  };
  cpu_set_t first, all;
  CPU_ZERO(&first);
  CPU_SET(0, &first);
  ::sched_getaffinity(0, sizeof all, &all);
  std::vector<pid_t> threads;  // of the servo thread's process in this machine's namespace
  for (const pid_t pid : processes("rtapi_app", "")) {
    for (const auto& entry : fs::directory_iterator("/proc/" + std::to_string(pid) + "/task")) {
      if (namespaceOf(pid) == namespaceOf(gateway.front())) {
        threads.push_back(static_cast<pid_t>(std::stol(entry.path().filename())));
      }
    }
  }
  ASSERT_FALSE(threads.empty());
  cut();
  for (const pid_t thread : threads) {
    ::sched_setaffinity(thread, sizeof first, &first);
  }
  // Longer than LivenessOptions::hangs.
  std::atomic<bool> over{false};
  bool permitted = false;
  std::thread rival([&] {
    permitted = occupy(0, 0.6);
    over = true;
  });
  double silent = 0.0, heard = now();
  std::size_t count = samples_.size();
  while (!over) {
    period();
    silent = std::max(silent, now() - heard);
    if (samples_.size() != count) {
      count = samples_.size();
      heard = now();
    }
  }
  rival.join();
  for (const pid_t thread : threads) {
    ::sched_setaffinity(thread, sizeof all, &all);
  }
  if (!permitted) {
    GTEST_SKIP() << "no permission for real-time priority";
  }
  EXPECT_GT(silent, 0.45);
  // The program continues.
  const double before = samples_.back().position[0];
  EXPECT_TRUE(until([&] { return samples_.back().position[0] > before + 5e-3; }));
  EXPECT_TRUE(bridge_->state().connected && bridge_->state().armed);
  EXPECT_EQ(stream_->statistics().lost, 0u);
  bridge_->cancel();
  EXPECT_EQ(outcome().code, MotionCode::cancelled);
}

TEST_F(LinuxCncMachine, AHangingStreamStopsTheMachine) {
  cut();
  const std::vector<pid_t> stream = processes("linuxcnc_stream", folder_);
  ASSERT_EQ(stream.size(), 1u);
  ::kill(stream.front(), SIGSTOP);
  EXPECT_LT(timeUntil([&] { return !bridge_->state().armed; }), latency());
  ::kill(stream.front(), SIGCONT);
  outcome();
  ASSERT_TRUE(until([&] { return bridge_->state().connected; }));
  EXPECT_TRUE(bridge_->state().emergency || bridge_->state().alarm);
  expectStandstill();
}

TEST_F(LinuxCncMachine, AHangingControllerIsDetected) {
  cut();
  const std::vector<pid_t> task = processes("milltask", folder_);
  ASSERT_FALSE(task.empty());
  for (const pid_t pid : task) {
    ::kill(pid, SIGSTOP);
  }
  EXPECT_LT(timeUntil([&] { return !bridge_->state().connected; }), latency());
  EXPECT_EQ(outcome().code, MotionCode::lost);
  expectStandstill();
  for (const pid_t pid : task) {
    ::kill(pid, SIGCONT);
  }
  ASSERT_TRUE(until([&] { return bridge_->state().connected; }));
  EXPECT_FALSE(bridge_->state().armed);
  expectStandstill();
  ready();
  until([] { return false; }, 0.1);
  const Answer<ArmCode> again = bridge_->arm(true);
  ASSERT_EQ(again.code, ArmCode::ok) << again.message;
  EXPECT_EQ(run("G90 G0 X0\n").code, MotionCode::ok);
}

TEST_F(LinuxCncMachine, WithoutItsControllerTheMachineStopsAndTheNextOneStartsClean) {
  cut();
  const std::vector<pid_t> task = processes("milltask", "mill.ini");
  ASSERT_FALSE(task.empty());
  for (const pid_t pid : task) {
    ::kill(pid, SIGKILL);
  }
  EXPECT_LT(timeUntil([&] { return !bridge_->state().connected; }), latency());
  EXPECT_EQ(outcome().code, MotionCode::lost);
  // The servo thread still runs, without the permit.
  expectStandstill();
  bridge_.reset();
  stop();
  EXPECT_TRUE(processes("rtapi_app", folder_).empty() && processes("linuxcnc_", folder_).empty());
  start();
  SetUp();
  if (!HasFatalFailure()) {
    EXPECT_EQ(run("G90 G0 X5\n").code, MotionCode::ok);
    EXPECT_NEAR(bridge_->state().position[0], 5e-3, 1e-9);
  }
}

}  // namespace
}  // namespace smartmill::cnc::linuxcnc
