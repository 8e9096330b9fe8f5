#pragma once

#include <cmath>
#include <cstdint>
#include <deque>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_daq/acquisition/acquisition.h"

namespace smartmill::daq::testing {

/// A device that does what a test says, in a time of its own.
class ScriptedDevice {
 public:
  struct Event {
    double time = 0.0;  // [s]
    std::optional<RawBatch> batch;
    std::string lost, malformed;  // reason, if not empty
  };

  void add(double time, RawBatch batch) { events_.push_back({time, std::move(batch), "", ""}); }
  void lose(double time, const std::string& reason) { events_.push_back({time, {}, reason, ""}); }
  void malformed(double time, const std::string& reason) { events_.push_back({time, {}, "", reason}); }

  /// While the device is gone, the time goes on with each look at it.
  double now() {
    if (gone_) now_ += 0.1;
    return now_;
  }
  std::unique_ptr<Driver> driver() { return std::make_unique<ScriptedDriver>(*this); }

 private:
  class ScriptedDriver : public Driver {
   public:
    explicit ScriptedDriver(ScriptedDevice& device) : device_(device) {}
    void open() override { device_.gone_ = false; }
    bool read(RawBatch* batch, double timeout) override { return device_.read(batch, timeout); }
    void close() override {}
    bool ended() const override { return device_.events_.empty(); }

   private:
    ScriptedDevice& device_;
  };

  bool read(RawBatch* batch, double timeout) {
    if (events_.empty()) return false;
    if (events_.front().time > now_ + timeout) {
      now_ += timeout;
      return false;
    }
    Event event = std::move(events_.front());
    events_.pop_front();
    now_ = std::max(now_, event.time);
    gone_ = !event.malformed.empty() || !event.lost.empty();
    if (!event.malformed.empty()) throw MalformedData(event.malformed);
    if (!event.lost.empty()) throw DeviceLost(event.lost);
    *batch = std::move(*event.batch);
    return true;
  }

  std::deque<Event> events_;
  double now_ = 1000.0;  // [s]
  bool gone_ = false;
};

}  // namespace smartmill::daq::testing
