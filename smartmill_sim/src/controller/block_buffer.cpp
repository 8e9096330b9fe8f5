#include "controller/block_buffer.h"

namespace smartmill::sim {

void BlockBuffer::append(const std::string& text) {
  if (position_ > 0 && position_ >= text_.size() / 2) {
    text_.erase(0, position_);
    position_ = 0;
  }
  text_ += text;
}

void BlockBuffer::clear() {
  text_.clear();
  position_ = 0;
}

std::optional<std::string> BlockBuffer::takeLine() {
  const std::size_t end = text_.find_first_of("\r\n", position_);
  if (end == std::string::npos) return std::nullopt;
  std::string line = text_.substr(position_, end - position_);
  position_ = end + 1;
  return line;
}

}  // namespace smartmill::sim
