#pragma once

#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <stdexcept>
#include <string>

namespace smartmill::fuzz {

/// A file in memory with these bytes; the same one at each call, readers open it by its name.
inline const std::string& scratchFile(const std::uint8_t* data, std::size_t size) {
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
