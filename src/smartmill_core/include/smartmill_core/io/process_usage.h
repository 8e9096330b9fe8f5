#pragma once

#include <cstdint>

namespace smartmill {

/// What a process uses, by proc(5).
struct ProcessUsage {
  double cpu_time = 0.0;          ///< [s] user and system time of all threads since its start
  double memory = 0.0;            ///< [byte] resident
  std::uint32_t descriptors = 0;  ///< [1] open files and sockets; 0 if another user's
  std::uint32_t threads = 0;      ///< [1]
};

/// @param process its number; 0: the calling one. @return all 0 if there is none
ProcessUsage processUsage(int process = 0);

}  // namespace smartmill
