#pragma once

#include <string>
#include <utility>
#include <vector>

namespace smartmill::cnc {

/// A line for the log.
struct Note {
  enum class Level { info, warning, error };
  Level level = Level::info;
  std::string text;
};

/// Lines that wait for whoever logs them.
class Log {
 public:
  void info(std::string text) { notes_.push_back({Note::Level::info, std::move(text)}); }
  void warning(std::string text) { notes_.push_back({Note::Level::warning, std::move(text)}); }
  void error(std::string text) { notes_.push_back({Note::Level::error, std::move(text)}); }
  std::vector<Note> take() { return std::exchange(notes_, {}); }

 private:
  std::vector<Note> notes_;
};

}  // namespace smartmill::cnc
