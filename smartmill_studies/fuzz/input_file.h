#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "smartmill_core/error.h"

namespace smartmill::fuzz {

/// Name of a file with these bytes, the same at each call. In ./test it is a file in memory
/// (scratch_file.cpp); in a fuzzer there is no file, and readText() returns the bytes (memory_file.cpp).
const std::string& inputFile(const std::uint8_t* data, std::size_t size);

/// A reader may refuse only with an error message.
template <class Read>
void readOrRefuse(const Read& read) {
  try {
    read();
  } catch (const Error&) {
    // The message states the fault and its position.
  }
}

}  // namespace smartmill::fuzz
