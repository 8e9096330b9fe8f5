#include "smartmill_core/stop_signal.h"

#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstring>

namespace smartmill {
namespace {

std::atomic<bool> stop_requested{false};  // also read by other threads
static_assert(std::atomic<bool>::is_always_lock_free);
const char* interrupt_line = "";

void requestStop(int) {
  stop_requested = true;
}

void interrupt(int) {
  stop_requested = true;
  [[maybe_unused]] const auto written = write(STDERR_FILENO, interrupt_line, std::strlen(interrupt_line));
  std::signal(SIGINT, SIG_DFL);
}

}  // namespace

void catchStopSignals() {
  std::signal(SIGINT, requestStop);
  std::signal(SIGTERM, requestStop);
}

void catchInterrupt(const char* line) {
  interrupt_line = line;
  std::signal(SIGINT, interrupt);
}

bool stopRequested() {
  return stop_requested;
}

}  // namespace smartmill
