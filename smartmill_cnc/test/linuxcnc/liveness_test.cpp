// Distinguishes a controller that has ended, one that hangs and one that waits for a processor.
#include "smartmill_cnc/linuxcnc/liveness.h"

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <string>
#include <thread>

#include "smartmill_cnc/linuxcnc/process_watch.h"

namespace smartmill::cnc::linuxcnc {
namespace {

using Verdict = Liveness::Verdict;

constexpr double STEP = 0.002;  // [s]

/// [s] from the last cycle to the verdict with constant evidence.
double verdictAfter(Verdict expected, const Liveness::Evidence& evidence, double step) {
  Liveness liveness;
  double now = 100.0;
  liveness.update(Liveness::Evidence{true, false, false}, now);
  for (;;) {
    now += step;
    const Verdict verdict = liveness.update(evidence, now);
    if (verdict != Verdict::lives) {
      EXPECT_EQ(verdict, expected);
      return now - 100.0;
    }
  }
}

TEST(Liveness, HangIsDetectedWithinHalfASecond) {
  EXPECT_NEAR(verdictAfter(Verdict::hangs, {false, false, false}, STEP), 0.4, 2 * STEP);
}

TEST(Liveness, EndIsDetectedAtOnce) {
  EXPECT_NEAR(verdictAfter(Verdict::ended, {false, true, false}, STEP), STEP, 1e-9);
}

TEST(Liveness, WaitForAProcessorIsToleratedForTwoSeconds) {
  EXPECT_NEAR(verdictAfter(Verdict::starves, {false, false, true}, STEP), 2.0, 2 * STEP);
}

TEST(Liveness, PausesOfTheObserverDoNotCount) {
  // Updates 0.3 s apart: 0.05 s of each count for the controller, so that 2 s pass before these reach 0.4 s.
  EXPECT_NEAR(verdictAfter(Verdict::starves, {false, false, false}, 0.3), 2.1, 1e-9);
  Liveness liveness;
  liveness.update(Liveness::Evidence{true, false, false}, 0.0);
  EXPECT_EQ(liveness.update(Liveness::Evidence{false, false, false}, 1.0), Verdict::lives);
  EXPECT_NEAR(liveness.starved(), 0.95, 1e-12);
  EXPECT_EQ(liveness.update(Liveness::Evidence{true, false, false}, 1.1), Verdict::lives);
  EXPECT_EQ(liveness.starved(), 0.0);
}

/// A named child process that is busy or asleep on processor 0, which all children share.
class Child {
 public:
  Child(const char* name, bool busy) : pid_(::fork()) {
    if (pid_ == 0) {
      ::prctl(PR_SET_PDEATHSIG, SIGKILL);
      ::prctl(PR_SET_NAME, name);
      cpu_set_t first;
      CPU_ZERO(&first);
      CPU_SET(0, &first);
      ::sched_setaffinity(0, sizeof first, &first);
      while (!busy) {
        ::pause();
      }
      for (volatile unsigned i = 0;; ++i) {
      }
    }
  }
  ~Child() {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  pid_t pid() const { return pid_; }

 private:
  const pid_t pid_;
};

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Number of checks in which a watched process waits for a processor.
int countWaits(ProcessWatch& watch, int checks) {
  int waits = 0;
  for (int i = 0; i < checks; ++i) {
    std::this_thread::sleep_for(std::chrono::duration<double>(1.2 * ProcessWatch::WINDOW));
    waits += watch.waitsForProcessor(now()) ? 1 : 0;
  }
  return waits;
}

TEST(ProcessWatch, DetectsAnEndedProcess) {
  const std::string name = "smw_e_" + std::to_string(::getpid());
  ProcessWatch watch;
  {
    const Child child(name.c_str(), false);
    while (watch.found() == 0) {
      watch.find({name});
    }
    EXPECT_FALSE(watch.ended());
    ::kill(child.pid(), SIGKILL);
    siginfo_t info{};
    ::waitid(P_PID, static_cast<id_t>(child.pid()), &info, WEXITED | WNOWAIT);
    EXPECT_TRUE(watch.ended());
    watch.find({name});
    EXPECT_EQ(watch.found(), 0u);  // a zombie does not count
  }
}

TEST(ProcessWatch, DistinguishesWaitingFromSleeping) {
  const std::string name = "smw_w_" + std::to_string(::getpid()),
                    idle = "smw_i_" + std::to_string(::getpid());
  const Child waits(name.c_str(), true), sleeps(idle.c_str(), false);
  sched_param none{};
  // Runs only if no other process does.
  ASSERT_EQ(::sched_setscheduler(waits.pid(), SCHED_IDLE, &none), 0);
  ProcessWatch watch, other;
  while (watch.found() == 0 || other.found() == 0) {
    watch.find({name});
    other.find({idle});
  }
  {
    const Child rival("smw_rival", true), another("smw_rival", true);
    EXPECT_GT(countWaits(watch, 40), 10);
    EXPECT_EQ(countWaits(other, 5), 0);
  }
  ::kill(waits.pid(), SIGSTOP);
  ASSERT_EQ(::waitpid(waits.pid(), nullptr, WUNTRACED), waits.pid());
  countWaits(watch, 1);
  EXPECT_EQ(countWaits(watch, 5), 0);  // a stopped process does not wait
}

}  // namespace
}  // namespace smartmill::cnc::linuxcnc
