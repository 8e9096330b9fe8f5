#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace smartmill {

/// How the bytes of a chunk are compressed.
enum class Packing { none, bz2, lz4, zstd };

/// Decompresses a chunk. Memory is taken as the output grows, not by the stated size.
/// @param size [byte] stated of the output @param trusted the same bytes had the right checksum before
/// @throws std::runtime_error on damaged bytes, or when the output is not of the stated size.
void unpack(Packing packing, const std::vector<std::uint8_t>& stored, std::size_t size, bool trusted,
            std::vector<std::uint8_t>& bytes);

/// Compresses a chunk (none, lz4, zstd); an LZ4 frame as roslz4 reads it. @throws std::runtime_error
std::string pack(Packing packing, const std::string& bytes);

}  // namespace smartmill
