#pragma once

#include <string>

namespace smartmill::report {

/// One word of a shell command, whatever is in it.
inline std::string shellQuoted(const std::string& word) {
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

}  // namespace smartmill::report
