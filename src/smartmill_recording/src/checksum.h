#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace smartmill {

/// CRC-32 of IEEE 802.3, as MCAP uses it.
/// @param before of the bytes before these; 0: none
std::uint32_t crc32(const std::uint8_t* bytes, std::size_t size, std::uint32_t before = 0);

/// MD5 (RFC 1321), in 32 hexadecimal digits.
std::string md5(const std::string& text);

}  // namespace smartmill
