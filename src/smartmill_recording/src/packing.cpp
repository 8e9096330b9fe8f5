#include "packing.h"

#include <bzlib.h>
#include <lz4frame.h>
#include <xxhash.h>
#include <zstd.h>

#include <algorithm>
#include <memory>
#include <stdexcept>

#include "little_endian.h"

namespace smartmill {
namespace {

constexpr std::size_t LZ4_FLAGS = 4;     // [byte] position of a frame's flags, behind its magic number
constexpr std::size_t LENGTH = 4;        // [byte] of a checksum
constexpr std::size_t USUAL_RATIO = 16;  // [1] that the output may have before memory for more is taken
constexpr std::size_t LEAST = 1 << 16;   // [byte]
constexpr std::size_t MOST_AT_ONCE = 1U << 30U;  // [byte] handed to bzip2, which counts in 32 bits
constexpr int ZSTD_LEVEL = 1;

/// Output that grows towards its stated size as it fills.
class Output {
 public:
  Output(std::vector<std::uint8_t>& bytes, std::size_t stored, std::size_t size)
      : bytes_(bytes), size_(size) {
    bytes_.resize(std::min(size, std::max(LEAST, USUAL_RATIO * stored)));
  }
  std::uint8_t* place() { return bytes_.data() + filled_; }
  std::size_t room() const { return bytes_.size() - filled_; }
  void take(std::size_t count) { filled_ += count; }
  /// @return false: as long as it may be
  bool grow() {
    if (bytes_.size() >= size_) return false;
    bytes_.resize(bytes_.size() > size_ / 2 ? size_ : 2 * bytes_.size());
    return true;
  }
  void finish() const {
    if (filled_ != size_) throw std::runtime_error("shorter than stated");
  }

 private:
  std::vector<std::uint8_t>& bytes_;
  std::size_t size_, filled_ = 0;
};

[[noreturn]] void tooLong() {
  throw std::runtime_error("not of the stated length");
}

void unpackLz4(const std::vector<std::uint8_t>& stored, std::size_t size, bool trusted,
               std::vector<std::uint8_t>& bytes) {
  LZ4F_dctx* made = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&made, LZ4F_VERSION)) != 0U)
    throw std::runtime_error("no memory");
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> context(
      made, &LZ4F_freeDecompressionContext);
  // Flags of the frame's descriptor (LZ4 frame format 1.6.2): bit 2 a checksum of the content behind the end
  // mark, bit 4 one behind each block. The checksum of the content is computed by its authors' own library:
  // the implementation inside the frame library takes five times as long, most of the time of decompression.
  const std::uint8_t flags = stored.size() > LZ4_FLAGS ? stored[LZ4_FLAGS] : 0;
  const bool of_content = (flags & 0x04U) != 0U, of_blocks = (flags & 0x10U) != 0U;
  LZ4F_decompressOptions_t options{};
  options.skipChecksums = trusted || (of_content && !of_blocks) ? 1 : 0;
  Output output(bytes, stored.size(), size);
  std::size_t from = 0, left = 1;
  while (left != 0) {
    std::size_t taken = stored.size() - from, given = output.room();
    left = LZ4F_decompress(context.get(), output.place(), &given, stored.data() + from, &taken, &options);
    if (LZ4F_isError(left) != 0U) throw std::runtime_error(LZ4F_getErrorName(left));
    from += taken;
    output.take(given);
    if (left != 0 && taken == 0 && given == 0 && (output.room() > 0 || !output.grow())) tooLong();
  }
  output.finish();
  if (trusted || !of_content || of_blocks) return;
  if (from < LENGTH ||
      numberAt<std::uint32_t>(stored.data() + from - LENGTH) != XXH32(bytes.data(), bytes.size(), 0))
    throw std::runtime_error("checksum mismatch");
}

void unpackZstd(const std::vector<std::uint8_t>& stored, std::size_t size, std::vector<std::uint8_t>& bytes) {
  const std::unique_ptr<ZSTD_DCtx, decltype(&ZSTD_freeDCtx)> context(ZSTD_createDCtx(), &ZSTD_freeDCtx);
  if (!context) throw std::runtime_error("no memory");
  Output output(bytes, stored.size(), size);
  ZSTD_inBuffer in{stored.data(), stored.size(), 0};
  while (true) {
    ZSTD_outBuffer out{output.place(), output.room(), 0};
    const std::size_t before = in.pos;
    const std::size_t left = ZSTD_decompressStream(context.get(), &out, &in);
    if (ZSTD_isError(left) != 0U) throw std::runtime_error(ZSTD_getErrorName(left));
    output.take(out.pos);
    if (left == 0 && in.pos == in.size) break;
    if (out.pos == 0 && in.pos == before && (output.room() > 0 || !output.grow())) tooLong();
  }
  output.finish();
}

void unpackBz2(const std::vector<std::uint8_t>& stored, std::size_t size, std::vector<std::uint8_t>& bytes) {
  if (stored.size() > MOST_AT_ONCE) throw std::runtime_error("too long");
  bz_stream stream{};
  if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK) throw std::runtime_error("no memory");
  const std::unique_ptr<bz_stream, decltype(&BZ2_bzDecompressEnd)> end(&stream, &BZ2_bzDecompressEnd);
  // bzip2's interface does not write through it.
  stream.next_in = const_cast<char*>(reinterpret_cast<const char*>(stored.data()));
  stream.avail_in = static_cast<unsigned>(stored.size());
  Output output(bytes, stored.size(), size);
  int state = BZ_OK;
  while (state != BZ_STREAM_END) {
    const auto room = static_cast<unsigned>(std::min(output.room(), MOST_AT_ONCE));
    const unsigned before = stream.avail_in;
    stream.next_out = reinterpret_cast<char*>(output.place());
    stream.avail_out = room;
    state = BZ2_bzDecompress(&stream);
    if (state != BZ_OK && state != BZ_STREAM_END) throw std::runtime_error("bzip2 data are damaged");
    output.take(room - stream.avail_out);
    if (state == BZ_OK && stream.avail_in == before && stream.avail_out == room &&
        (output.room() > 0 || !output.grow()))
      tooLong();
  }
  output.finish();
}

std::string packLz4(const std::string& bytes) {
  LZ4F_preferences_t preferences{};
  preferences.frameInfo.blockMode = LZ4F_blockIndependent;
  preferences.frameInfo.blockSizeID = LZ4F_max4MB;
  preferences.frameInfo.contentChecksumFlag = LZ4F_contentChecksumEnabled;
  std::string packed(LZ4F_compressFrameBound(bytes.size(), &preferences), '\0');
  const std::size_t size =
      LZ4F_compressFrame(packed.data(), packed.size(), bytes.data(), bytes.size(), &preferences);
  if (LZ4F_isError(size) != 0U) throw std::runtime_error(LZ4F_getErrorName(size));
  packed.resize(size);
  return packed;
}

std::string packZstd(const std::string& bytes) {
  std::string packed(ZSTD_compressBound(bytes.size()), '\0');
  const std::size_t size =
      ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), ZSTD_LEVEL);
  if (ZSTD_isError(size) != 0U) throw std::runtime_error(ZSTD_getErrorName(size));
  packed.resize(size);
  return packed;
}

}  // namespace

void unpack(Packing packing, const std::vector<std::uint8_t>& stored, std::size_t size, bool trusted,
            std::vector<std::uint8_t>& bytes) {
  switch (packing) {
    case Packing::none:
      if (stored.size() != size) tooLong();
      bytes = stored;
      return;
    case Packing::bz2:
      return unpackBz2(stored, size, bytes);
    case Packing::lz4:
      return unpackLz4(stored, size, trusted, bytes);
    case Packing::zstd:
      return unpackZstd(stored, size, bytes);
  }
}

std::string pack(Packing packing, const std::string& bytes) {
  switch (packing) {
    case Packing::lz4:
      return packLz4(bytes);
    case Packing::zstd:
      return packZstd(bytes);
    case Packing::none:
      return bytes;
    case Packing::bz2:
      break;
  }
  throw std::runtime_error("bzip2 is not written");
}

}  // namespace smartmill
