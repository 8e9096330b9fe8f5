// Replaces smartmill_core/io/text_file.cpp: every file contains the input of the fuzzer.
#include "fuzz/input_file.h"
#include "smartmill_core/io/text_file.h"

namespace smartmill {
namespace {

std::string& content() {
  static std::string text;
  return text;
}

}  // namespace

std::string readText(const std::string& file) {
  (void)file;
  return content();
}

void writeText(const std::string& file, const std::string& text) {
  (void)text;
  throw Error(file + ": cannot be written");
}

const std::string& fuzz::inputFile(const std::uint8_t* data, std::size_t size) {
  static const std::string NAME = "fuzzed";
  content().assign(reinterpret_cast<const char*>(data), size);
  return NAME;
}

}  // namespace smartmill
