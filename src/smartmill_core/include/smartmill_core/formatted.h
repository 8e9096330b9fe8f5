#pragma once

#include <string>

namespace smartmill {

/// The text that printf would print, of any length.
std::string formatted(const char* format, ...) __attribute__((format(printf, 1, 2)));

}  // namespace smartmill
