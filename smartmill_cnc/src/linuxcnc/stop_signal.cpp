#include "smartmill_cnc/linuxcnc/stop_signal.h"

#include <csignal>

namespace smartmill::cnc::linuxcnc {
namespace {

volatile std::sig_atomic_t stop_requested = 0;

void requestStop(int) {
  stop_requested = 1;
}

}  // namespace

void catchStopSignals() {
  std::signal(SIGINT, requestStop);
  std::signal(SIGTERM, requestStop);
}

bool stopRequested() {
  return stop_requested != 0;
}

}  // namespace smartmill::cnc::linuxcnc
