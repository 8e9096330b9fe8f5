#include "smartmill_core/io/text_file.h"

#include <filesystem>
#include <fstream>

#include "smartmill_core/error.h"

namespace smartmill {

std::string readText(const std::string& file) {
  std::ifstream stream(file, std::ios::binary | std::ios::ate);
  if (!stream) throw Error(file + ": cannot be read");
  const std::streamoff size = stream.tellg();
  // A folder can be opened, with an arbitrary size.
  if (size < 0 || std::filesystem::is_directory(file)) throw Error(file + ": cannot be read");
  std::string text(static_cast<std::size_t>(size), '\0');
  stream.seekg(0);
  stream.read(text.data(), size);
  if (!stream) throw Error(file + ": cannot be read");
  return text;
}

void writeText(const std::string& file, const std::string& text) {
  std::ofstream stream(file, std::ios::binary);
  stream << text;
  stream.close();
  if (!stream) throw Error(file + ": cannot be written");
}

}  // namespace smartmill
