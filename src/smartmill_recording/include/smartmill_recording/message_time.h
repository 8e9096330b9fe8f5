#pragma once

#include <cstdint>

namespace smartmill::plain {

/// A date of a recorded message.
struct Time {
  std::uint32_t sec = 0;   ///< [s] since 1970-01-01
  std::uint32_t nsec = 0;  ///< [ns] below one second
};

struct Duration {
  std::int32_t sec = 0;   ///< [s]
  std::int32_t nsec = 0;  ///< [ns]
};

}  // namespace smartmill::plain
