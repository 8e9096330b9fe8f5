#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace smartmill {

/// An unsigned number from its bytes, least first.
template <class Number>
Number numberAt(const std::uint8_t* bytes) {
  std::uint64_t number = 0;
  for (std::size_t i = sizeof(Number); i-- > 0;) number = number << 8U | bytes[i];
  return static_cast<Number>(number);
}

template <class Number>
Number numberAt(const char* bytes) {
  return numberAt<Number>(reinterpret_cast<const std::uint8_t*>(bytes));
}

template <class Number>
void appendNumber(std::string& bytes, Number number) {
  for (std::size_t i = 0; i < sizeof(Number); ++i)
    bytes.push_back(static_cast<char>(static_cast<std::uint64_t>(number) >> (8 * i) & 0xFFU));
}

}  // namespace smartmill
