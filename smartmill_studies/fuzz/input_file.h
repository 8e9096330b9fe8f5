#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "smartmill_core/error.h"

namespace smartmill::fuzz {

/// The name of a file with these bytes, the same one at each call. In ./test it is a file in memory
/// (scratch_file.cpp); in a fuzzer there is none: readText() hands the bytes out (memory_file.cpp).
const std::string& inputFile(const std::uint8_t* data, std::size_t size);

/// A reader may refuse with a line, and with nothing else.
template <class Read>
void told(const Read& read) {
  try {
    read();
  } catch (const Error&) {
    // Names what and where.
  }
}

}  // namespace smartmill::fuzz
