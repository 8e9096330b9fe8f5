#pragma once

#include <cstdint>
#include <functional>
#include <utility>

#include "smartmill_focas/server.h"

namespace smartmill::sim {

/// The calendar of a control: a wall clock with an adjustable offset.
class CalendarClock {
 public:
  /// @param wall_clock [s] since 1970; empty: the computer's local time
  explicit CalendarClock(std::function<std::int64_t()> wall_clock) : wall_clock_(std::move(wall_clock)) {}

  focas::DateTime now() const;
  void set(const focas::DateTime& date_time);

 private:
  std::int64_t seconds() const;

  std::function<std::int64_t()> wall_clock_;
  std::int64_t offset_ = 0;  // [s]
};

}  // namespace smartmill::sim
