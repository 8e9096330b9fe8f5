#pragma once

#include <string>
#include <utility>
#include <vector>

namespace smartmill::cnc {

/// One line of the log.
struct LogEntry {
  enum class Level { info, warning, error };
  Level level = Level::info;
  std::string text;
};

/// Collects log lines until the caller publishes them.
class Log {
 public:
  void info(std::string text) { entries_.push_back({LogEntry::Level::info, std::move(text)}); }
  void warning(std::string text) { entries_.push_back({LogEntry::Level::warning, std::move(text)}); }
  void error(std::string text) { entries_.push_back({LogEntry::Level::error, std::move(text)}); }
  std::vector<LogEntry> take() { return std::exchange(entries_, {}); }

 private:
  std::vector<LogEntry> entries_;
};

}  // namespace smartmill::cnc
