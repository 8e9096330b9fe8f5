#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "smartmill_cnc/linuxcnc/local_socket.h"

namespace smartmill::cnc::linuxcnc {

/// Detects through the kernel (/proc) that other processes have ended or wait for a processor.
class ProcessWatch {
 public:
  static constexpr double WINDOW = 0.02;  ///< [s] longer than the kernel takes to account run time

  /// Watches the process with the lowest number of each name (/proc/PID/comm), which excludes its short-lived
  /// children of the same name.
  void find(const std::vector<std::string>& names);
  /// Watches this process only.
  void watch(int pid);
  std::size_t found() const { return processes_.size(); }

  /// Whether a watched process has ended.
  bool ended() const;

  /// Whether one of their threads was runnable in the last window and did not run. The first call only starts
  /// the window. @param now [s]
  bool waitsForProcessor(double now);

 private:
  struct Process {
    int pid;
    LocalDescriptor handle;
  };

  void add(int pid);

  std::vector<Process> processes_;
  std::map<int, std::uint64_t> run_times_;  // [ns] by thread
  double last_check_ = -std::numeric_limits<double>::infinity();
  bool waiting_ = false;
};

}  // namespace smartmill::cnc::linuxcnc
