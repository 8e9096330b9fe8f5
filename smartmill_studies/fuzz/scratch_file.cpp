#include <unistd.h>

#include <cstdio>
#include <stdexcept>

#include "fuzz/input_file.h"

namespace smartmill::fuzz {

const std::string& inputFile(const std::uint8_t* data, std::size_t size) {
  static const std::string NAME = "/dev/shm/smartmill_fuzz_" + std::to_string(::getpid());
  FILE* const file = std::fopen(NAME.c_str(), "wb");
  if (file == nullptr) {
    throw std::runtime_error(NAME + ": cannot be written");
  }
  std::fwrite(data, 1, size, file);
  std::fclose(file);
  return NAME;
}

}  // namespace smartmill::fuzz
