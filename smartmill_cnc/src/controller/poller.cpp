#include "smartmill_cnc/controller/poller.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace smartmill::cnc {
namespace {

constexpr int MANY_FAILURES = 10;  // more are not counted

}  // namespace

Poller::Poller(Controller& controller, const PollerOptions& options, Log& log)
    : controller_(controller), options_(options), wait_(options.reconnect_period), log_(log) {
}

void Poller::fetch(double now) {
  reading_.reset();
  if (!controller_.connected()) {
    // A clock that jumps back must not delay the next attempt.
    if (now < next_connect_ && now >= next_connect_ - wait_) {
      return;
    }
    connect();
    const double times =
        controller_.connected() ? 1.0 : std::min(std::ldexp(1.0, failures_), options_.longest_wait);
    failures_ = controller_.connected() ? 0 : std::min(failures_ + 1, MANY_FAILURES);
    wait_ = times * options_.reconnect_period;
    next_connect_ = now + wait_;
  }
  if (!controller_.connected()) {
    return;
  }
  Result<Reading> reading = controller_.read();
  if (reading) {
    reading_ = *reading;
  } else {
    last_error_ = reading.failure().message;
  }
}

void Poller::connect() {
  ++counts_.attempts;
  const Result<std::string> identity = controller_.connect();
  refused_ = !identity && identity.failure().kind != Failure::Kind::lost;
  if (identity) {
    identity_ = *identity;
  } else {
    last_error_ = identity.failure().message;
  }
}

std::optional<Reading> Poller::takeReading() {
  // A command may have lost the connection since.
  if (!reading_ || !controller_.connected()) {
    return std::nullopt;
  }
  if (!std::exchange(connected_, true)) {
    ++counts_.made;
    logged_error_.clear();
    std::string axes;
    for (const std::string& axis : reading_->state.axes) {
      axes += " " + axis;
    }
    log_.info("connected to the " + controller_.name() + ": " + identity_ + ", axes" + axes);
  }
  return std::exchange(reading_, std::nullopt);
}

void Poller::reportDisconnected() {
  const bool was_connected = std::exchange(connected_, false);
  // The controller may start together with this program: one failed attempt is not logged.
  if (counts_.attempts <= 1 && !was_connected && !refused_) return;
  counts_.lost += was_connected ? 1 : 0;
  // Failing to reach the controller after a loss is expected and not logged; a refused connection is.
  const bool expected = loss_logged_ && !was_connected && !refused_;
  if (was_connected || (last_error_ != logged_error_ && !expected)) {
    log_.error(last_error_ + "; trying again every " + fixedDecimals(options_.reconnect_period, 1) + " to " +
               fixedDecimals(options_.longest_wait * options_.reconnect_period, 1) + " s");
  }
  loss_logged_ = was_connected || (loss_logged_ && last_error_ == logged_error_);
  logged_error_ = last_error_;
}

}  // namespace smartmill::cnc
