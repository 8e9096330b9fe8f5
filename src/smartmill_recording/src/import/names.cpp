#include "smartmill_recording/import/names.h"

#include <cctype>

namespace smartmill::recording {

std::string lastPart(const std::string& name) {
  const std::size_t at = name.find_last_of("./");
  return at == std::string::npos ? name : name.substr(at + 1);
}

std::string trimmed(const std::string& text) {
  const std::size_t begin = text.find_first_not_of(" \t");
  return begin == std::string::npos ? "" : text.substr(begin, text.find_last_not_of(" \t") + 1 - begin);
}

std::string plainName(const std::string& name) {
  std::string plain;
  for (const char c : lastPart(name)) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalnum(byte)) plain += static_cast<char>(std::tolower(byte));
  }
  return plain;
}

}  // namespace smartmill::recording
