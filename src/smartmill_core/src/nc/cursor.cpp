#include "smartmill_core/nc/cursor.h"

#include "smartmill_core/nc/syntax_error.h"

namespace smartmill::nc {

Cursor::Cursor(const std::string& line, const Dialect& dialect) {
  std::size_t comment = 0;  // column of its '('; 0: none is open
  const auto refuse = [](std::size_t column, const std::string& fault) {
    throw SyntaxError(SyntaxError::Kind::comment, column, "(", "", fault);
  };
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (comment != 0) {
      if (c == '(' && dialect.strict_comments) refuse(i + 1, "'(' in a comment, expected ')' first");
      if (c == ')') comment = 0;
    } else if (c == '(') {
      comment = i + 1;
    } else if (c == ')' && dialect.strict_comments) {
      refuse(i + 1, "')' without '('");
    } else if (dialect.blanks.find(c) == std::string_view::npos) {
      text_ += static_cast<char>(c >= 'a' && c <= 'z' ? c - 'a' + 'A' : c);
      columns_.push_back(i + 1);
    }
  }
  if (comment != 0) refuse(comment, "comment is not closed, expected ')'");
  columns_.push_back(line.size() + 1);
}

}  // namespace smartmill::nc
