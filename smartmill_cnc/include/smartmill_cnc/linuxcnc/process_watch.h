#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "smartmill_cnc/linuxcnc/local_socket.h"

namespace smartmill::cnc::linuxcnc {

/// What the kernel tells of other processes: that they have ended, that they wait for a processor.
class ProcessWatch {
 public:
  static constexpr double WINDOW = 0.02;  ///< [s] longer than the kernel takes to account what has run

  /// Of each of these names (/proc/PID/comm) the process with the lowest number: what it starts for a moment
  /// under its own name is not meant.
  void find(const std::vector<std::string>& names);
  /// This one, and no other.
  void only(int pid);
  std::size_t found() const { return processes_.size(); }

  /// One of them has ended since it was found.
  bool ended() const;

  /// In the last window one of their threads was runnable and did not run. The first call only begins to
  /// look. @param now [s]
  bool waits(double now);

 private:
  struct Process {
    int pid;
    LocalDescriptor handle;
  };

  void add(int pid);

  std::vector<Process> processes_;
  std::map<int, std::uint64_t> ran_;  // [ns] by thread
  double looked_ = -std::numeric_limits<double>::infinity();
  bool waits_ = false;
};

}  // namespace smartmill::cnc::linuxcnc
