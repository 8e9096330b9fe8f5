#include "checksum.h"

#include <zlib.h>

#include <array>
#include <cmath>

#include "little_endian.h"

namespace smartmill {
namespace {

std::uint32_t rotated(std::uint32_t value, unsigned by) {
  return value << by | value >> (32U - by);
}

/// One block of 64 bytes (RFC 1321, 3.4).
void digest(const std::uint8_t* block, std::array<std::uint32_t, 4>& state) {
  constexpr unsigned SHIFTS[4][4] = {{7, 12, 17, 22}, {5, 9, 14, 20}, {4, 11, 16, 23}, {6, 10, 15, 21}};
  std::uint32_t a = state[0], b = state[1], c = state[2], d = state[3];
  for (unsigned i = 0; i < 64; ++i) {
    const unsigned round = i / 16;
    std::uint32_t mixed = 0;
    unsigned word = 0;
    switch (round) {
      case 0:
        mixed = (b & c) | (~b & d), word = i;
        break;
      case 1:
        mixed = (d & b) | (~d & c), word = (5 * i + 1) % 16;
        break;
      case 2:
        mixed = b ^ c ^ d, word = (3 * i + 5) % 16;
        break;
      default:
        mixed = c ^ (b | ~d), word = 7 * i % 16;
    }
    const auto sine = static_cast<std::uint32_t>(std::floor(std::abs(std::sin(i + 1.0)) * 4294967296.0));
    mixed += a + sine + numberAt<std::uint32_t>(block + std::size_t{4} * word);
    a = d, d = c, c = b;
    b += rotated(mixed, SHIFTS[round][i % 4]);
  }
  state[0] += a, state[1] += b, state[2] += c, state[3] += d;
}

}  // namespace

std::uint32_t crc32(const std::uint8_t* bytes, std::size_t size, std::uint32_t before) {
  return static_cast<std::uint32_t>(::crc32_z(before, bytes, size));
}

std::string md5(const std::string& text) {
  std::string padded = text + '\x80';
  while (padded.size() % 64 != 56) padded.push_back('\0');
  appendNumber(padded, std::uint64_t{8} * text.size());
  std::array<std::uint32_t, 4> state{0x67452301U, 0xEFCDAB89U, 0x98BADCFEU, 0x10325476U};
  for (std::size_t at = 0; at < padded.size(); at += 64)
    digest(reinterpret_cast<const std::uint8_t*>(padded.data()) + at, state);
  std::string bytes, digits;
  for (const std::uint32_t word : state) appendNumber(bytes, word);
  for (const char c : bytes) {
    const auto byte = static_cast<unsigned char>(c);
    digits += "0123456789abcdef"[byte >> 4U];
    digits += "0123456789abcdef"[byte & 15U];
  }
  return digits;
}

}  // namespace smartmill
