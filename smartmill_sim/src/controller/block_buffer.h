#pragma once

#include <cstddef>
#include <optional>
#include <string>

namespace smartmill::sim {

/// Received program text that has not run.
class BlockBuffer {
 public:
  std::size_t size() const { return text_.size() - position_; }
  void append(const std::string& text);
  void clear();
  bool hasLine() const { return text_.find_first_of("\r\n", position_) != std::string::npos; }
  /// The next line without its end; nullopt: no complete line.
  std::optional<std::string> takeLine();
  /// The next text, at most `most` bytes.
  std::string preview(std::size_t most) const { return text_.substr(position_, most); }

 private:
  std::string text_;
  std::size_t position_ = 0;
};

}  // namespace smartmill::sim
