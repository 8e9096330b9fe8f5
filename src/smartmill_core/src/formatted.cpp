#include "smartmill_core/formatted.h"

#include <cstdarg>
#include <cstdio>

namespace smartmill {

std::string formatted(const char* format, ...) {
  va_list arguments, again;
  va_start(arguments, format);
  va_copy(again, arguments);
  char line[200];
  const int length = std::vsnprintf(line, sizeof line, format, arguments);
  va_end(arguments);
  std::string text(length > 0 ? static_cast<std::size_t>(length) : 0, '\0');
  if (text.size() < sizeof line)
    text.assign(line, text.size());
  else
    std::vsnprintf(text.data(), text.size() + 1, format, again);
  va_end(again);
  return text;
}

std::string joined(const std::vector<std::string>& texts, const char* between) {
  std::string text;
  for (const std::string& one : texts) text += (text.empty() ? "" : between) + one;
  return text;
}

}  // namespace smartmill
