#pragma once

#include <string>

namespace smartmill {

/// First line of a file that only its owner can read, without blanks at its end. @param key of the parameter
/// that names the file, for the message. @throws Error when the file cannot be read, or others can read it
std::string readSecret(const std::string& key, const std::string& file);

}  // namespace smartmill
