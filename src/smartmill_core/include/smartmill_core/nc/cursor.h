#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "smartmill_core/nc/dialect.h"

namespace smartmill::nc {

inline bool isDigit(char c) {
  return c >= '0' && c <= '9';
}
inline bool isSign(char c) {
  return c == '-' || c == '+';
}

/// The significant characters of a line, in upper case without blanks and comments, and a position in them.
class Cursor {
 public:
  /// @throws SyntaxError (comment)
  Cursor(const std::string& line, const Dialect& dialect);

  const std::string& text() const { return text_; }
  std::size_t position() const { return position_; }
  std::size_t column() const { return columns_[position_]; }  ///< of the position in the line, from 1
  /// The text from an earlier position to the present one.
  std::string since(std::size_t start) const { return text_.substr(start, position_ - start); }

  bool done() const { return position_ == text_.size(); }
  char peek(std::size_t ahead = 0) const {
    return position_ + ahead < text_.size() ? text_[position_ + ahead] : '\0';
  }
  char take() { return done() ? '\0' : text_[position_++]; }
  bool startsWith(std::string_view word) const { return text_.compare(position_, word.size(), word) == 0; }
  /// Takes a word if it follows.
  bool accept(std::string_view word) {
    const bool follows = startsWith(word);
    position_ += follows ? word.size() : 0;
    return follows;
  }

 private:
  std::string text_;
  std::vector<std::size_t> columns_;  // of the characters of text_, and that behind the line
  std::size_t position_ = 0;
};

}  // namespace smartmill::nc
