#pragma once

#include <cstdio>
#include <string>

namespace smartmill::discrepancy {

/// What printf would print, up to 300 characters.
template <class... Values>
std::string formatted(const char* format, Values... values) {
  char line[300];
  std::snprintf(line, sizeof line, format, values...);
  return line;
}

}  // namespace smartmill::discrepancy
