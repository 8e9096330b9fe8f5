#pragma once

#include <string>
#include <vector>

namespace smartmill {

/// The text that printf would print, of any length. By hand, since the headers of fmt take 0.2 s in each of
/// the 126 files that format, for twenty lines less.
std::string formatted(const char* format, ...) __attribute__((format(printf, 1, 2)));

/// The texts in a row.
std::string joined(const std::vector<std::string>& texts, const char* between = ", ");

}  // namespace smartmill
