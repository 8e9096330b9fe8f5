#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/streams.h"

/// Fields that messages share.
namespace smartmill::conversion {

inline void requireLength(const char* field, std::size_t length, std::size_t expected) {
  if (length != expected) {
    throw Error(std::string(field) + ": " + std::to_string(length) + " values, expected " +
                std::to_string(expected));
  }
}

inline void requireRate(double rate) {
  if (!(rate > 0.0) || !std::isfinite(rate)) {
    throw Error("sample_rate: " + std::to_string(rate) + " Hz, expected a rate above 0");
  }
}

template <class Time>
double secondsOf(const Time& stamp) {
  return static_cast<double>(stamp.sec) + 1e-9 * static_cast<double>(stamp.nsec);
}

/// Nearest nanosecond. @throws Error when not finite, negative or beyond 32 bits of seconds.
template <class Time>
Time timeOf(double stamp) {
  constexpr double BEYOND = 4294967295.0;    // [s]
  constexpr std::int64_t NANO = 1000000000;  // [ns/s]
  if (!std::isfinite(stamp) || stamp < 0.0 || stamp > BEYOND) {
    throw Error("stamp: " + std::to_string(stamp) + " s, expected a time from 0 to 2^32 s");
  }
  const double whole = std::floor(stamp);
  const auto rest = static_cast<std::int64_t>(std::llround((stamp - whole) * 1e9));
  Time time;
  time.sec = static_cast<std::uint32_t>(static_cast<std::int64_t>(whole) + rest / NANO);
  time.nsec = static_cast<std::uint32_t>(rest % NANO);
  return time;
}

template <class M>
void setStamp(double stamp, M& m) {
  m.header.stamp = timeOf<decltype(m.header.stamp)>(stamp);
}

template <class Point>
std::array<double, 3> fromPoint(const Point& p) {
  return {p.x, p.y, p.z};
}

template <class Point>
void setPoint(const std::array<double, 3>& p, Point& point) {
  point.x = p[0];
  point.y = p[1];
  point.z = p[2];
}

/// A series that the core leaves empty when unknown is all NaN in a message.
inline std::vector<double> orUnknown(const std::vector<double>& values, std::size_t size) {
  return values.empty() ? std::vector<double>(size, NOT_A_NUMBER) : values;
}

}  // namespace smartmill::conversion
