#include "controller/calendar_clock.h"

#include <ctime>

namespace smartmill::sim {
namespace {

std::int64_t secondsOf(const focas::DateTime& at) {
  std::tm parts{};
  parts.tm_year = at.year - 1900;
  parts.tm_mon = at.month - 1;
  parts.tm_mday = at.day;
  parts.tm_hour = at.hour;
  parts.tm_min = at.minute;
  parts.tm_sec = at.second;
  return timegm(&parts);
}

/// Wall clock of the computer in local time.
std::int64_t localSeconds() {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  localtime_r(&now, &parts);
  return timegm(&parts);
}

}  // namespace

std::int64_t CalendarClock::seconds() const {
  return (wall_clock_ ? wall_clock_() : localSeconds()) + offset_;
}

focas::DateTime CalendarClock::now() const {
  const std::time_t time = seconds();
  std::tm parts{};
  gmtime_r(&time, &parts);
  return {parts.tm_year + 1900, parts.tm_mon + 1, parts.tm_mday, parts.tm_hour, parts.tm_min, parts.tm_sec};
}

void CalendarClock::set(const focas::DateTime& date_time) {
  offset_ += secondsOf(date_time) - seconds();
}

}  // namespace smartmill::sim
