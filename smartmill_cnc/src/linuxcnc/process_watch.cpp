#include "smartmill_cnc/linuxcnc/process_watch.h"

#include <dirent.h>
#include <poll.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <memory>

namespace smartmill::cnc::linuxcnc {
namespace {

/// Entries of a folder whose names are numbers.
std::vector<int> numbersIn(const std::string& folder) {
  std::vector<int> numbers;
  const std::unique_ptr<DIR, int (*)(DIR*)> entries(::opendir(folder.c_str()), ::closedir);
  while (const dirent* entry = entries ? ::readdir(entries.get()) : nullptr) {
    const int number = std::atoi(entry->d_name);
    if (number > 0) {
      numbers.push_back(number);
    }
  }
  return numbers;
}

/// First line of a file of /proc; empty if it no longer exists.
std::string lineOf(const std::string& file) {
  char line[512] = "";
  const std::unique_ptr<FILE, int (*)(FILE*)> stream(std::fopen(file.c_str(), "r"), std::fclose);
  if (!stream || !std::fgets(line, sizeof line, stream.get())) {
    return {};
  }
  return line;
}

/// State of a thread, which follows the name in parentheses (proc(5)).
char stateOf(const std::string& thread) {
  const std::string line = lineOf(thread + "/stat");
  const std::size_t name = line.rfind(')');
  return name != std::string::npos && name + 2 < line.size() ? line[name + 2] : '?';
}

}  // namespace

void ProcessWatch::find(const std::vector<std::string>& names) {
  processes_.clear();
  run_times_.clear();
  std::map<std::string, int> oldest;
  for (const int pid : numbersIn("/proc")) {
    const std::string folder = "/proc/" + std::to_string(pid);
    std::string name = lineOf(folder + "/comm");
    name = name.substr(0, name.find('\n'));
    if (std::find(names.begin(), names.end(), name) != names.end() && stateOf(folder) != 'Z') {
      const auto [at, first] = oldest.emplace(name, pid);
      at->second = std::min(at->second, pid);
    }
  }
  for (const auto& [name, pid] : oldest) {
    add(pid);
  }
}

void ProcessWatch::watch(int pid) {
  processes_.clear();
  run_times_.clear();
  add(pid);
}

void ProcessWatch::add(int pid) {
  // glibc 2.36 declares pidfd_open() for C only.
  LocalDescriptor handle(static_cast<int>(::syscall(SYS_pidfd_open, pid, 0)));
  if (handle.valid()) {
    processes_.push_back({pid, std::move(handle)});
  }
}

bool ProcessWatch::ended() const {
  return std::any_of(processes_.begin(), processes_.end(), [](const Process& process) {
    pollfd entry{process.handle.get(), POLLIN, 0};
    return ::poll(&entry, 1, 0) == 1;
  });
}

bool ProcessWatch::waitsForProcessor(double now) {
  if (now - last_check_ < WINDOW) {
    return waiting_;
  }
  last_check_ = now;
  waiting_ = false;
  std::map<int, std::uint64_t> run_times;
  for (const Process& process : processes_) {
    const std::string threads = "/proc/" + std::to_string(process.pid) + "/task/";
    for (const int thread : numbersIn(threads)) {
      const std::string folder = threads + std::to_string(thread);
      // schedstat: run time [ns], waiting time, number of slices. The waiting time does not include a wait
      // that still lasts.
      run_times[thread] = std::strtoull(lineOf(folder + "/schedstat").c_str(), nullptr, 10);
      const auto before = run_times_.find(thread);
      waiting_ = waiting_ || (before != run_times_.end() && before->second == run_times[thread] &&
                              stateOf(folder) == 'R');
    }
  }
  run_times_ = std::move(run_times);
  return waiting_;
}

}  // namespace smartmill::cnc::linuxcnc
