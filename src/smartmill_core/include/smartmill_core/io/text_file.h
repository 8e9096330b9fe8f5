#pragma once

#include <string>

namespace smartmill {

/// @throws Error "FILE: cannot be read".
std::string readText(const std::string& file);

/// Replaces the file. @throws Error "FILE: cannot be written".
void writeText(const std::string& file, const std::string& text);

}  // namespace smartmill
