#include "smartmill_ros/bag_file.h"

#include <lz4frame.h>
#include <rosbag/stream.h>

#include <algorithm>
#include <fstream>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "smartmill_core/error.h"

namespace smartmill {
namespace {

constexpr const char* VERSION_LINE = "#ROSBAG V2.0\n";
constexpr std::size_t VERSION_SIZE = 13;  // [byte]
constexpr std::size_t LENGTH = 4;         // [byte] of a record's lengths
constexpr std::uint32_t NANO = 1000000000;
constexpr std::size_t KEPT = 4;  // chunks, since neighbours overlap in time

enum class Op : std::uint8_t { message = 2, bag = 3, index = 4, chunk = 5, chunk_info = 6, connection = 7 };

// How much a byte can hold at most: LZ4's length codes, bzip2's blocks of 900 kB of one value.
constexpr std::uint64_t LZ4_MOST = 256, BZ2_MOST = 25000, SLACK = 1 << 16;

/// Little-endian.
std::uint32_t numberAt(const char* bytes) {
  std::uint32_t number = 0;
  for (int i = 3; i >= 0; --i) {
    number = number << 8U | static_cast<unsigned char>(bytes[i]);
  }
  return number;
}
std::uint32_t numberAt(const std::uint8_t* bytes) {
  return numberAt(reinterpret_cast<const char*>(bytes));
}

/// By the system's library: rosbag's own spends most of its time on the checksum, which counts once.
/// @param trusted the checksum was right before. @throws std::runtime_error
void unpackLz4(const std::vector<std::uint8_t>& stored, std::vector<std::uint8_t>& bytes, bool trusted) {
  LZ4F_dctx* made = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&made, LZ4F_VERSION)) != 0U)
    throw std::runtime_error("no memory");
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> context(
      made, &LZ4F_freeDecompressionContext);
  LZ4F_decompressOptions_t options{};
  options.skipChecksums = trusted ? 1 : 0;
  std::size_t from = 0, to = 0, left = 1;
  while (left != 0) {
    std::size_t taken = stored.size() - from, given = bytes.size() - to;
    left = LZ4F_decompress(context.get(), bytes.data() + to, &given, stored.data() + from, &taken, &options);
    if (LZ4F_isError(left) != 0U) throw std::runtime_error(LZ4F_getErrorName(left));
    if (left != 0 && taken == 0 && given == 0) throw std::runtime_error("not of the length it tells of");
    from += taken;
    to += given;
  }
  if (to != bytes.size()) throw std::runtime_error("shorter than it tells");
}

}  // namespace

/// name=value fields, where they stand.
struct BagFile::Header {
  const char* data;
  std::size_t size;

  /// The bytes that are left begin with a whole field.
  static bool whole(const char* at, std::size_t left) {
    return left >= LENGTH && numberAt(at) <= left - LENGTH;
  }
  /// The value of a field; the first, where a name stands twice.
  std::optional<std::string_view> find(std::string_view name) const {
    for (std::size_t at = 0; at < size;) {
      const std::string_view field(data + at + LENGTH, numberAt(data + at));
      if (field.size() > name.size() && field[name.size()] == '=' && field.substr(0, name.size()) == name) {
        return field.substr(name.size() + 1);
      }
      at += LENGTH + field.size();
    }
    return std::nullopt;
  }
  std::optional<std::uint32_t> number(std::string_view name, std::size_t place = 0) const {
    const std::optional<std::string_view> value = find(name);
    if (!value || value->size() < 4 * (place + 1)) {
      return std::nullopt;
    }
    return numberAt(value->data() + 4 * place);
  }
  std::string word(std::string_view name) const { return std::string(find(name).value_or("")); }
  Op op() const {
    const std::optional<std::string_view> code = find("op");
    return static_cast<Op>(code && code->size() == 1 ? static_cast<unsigned char>(code->front()) : 0);
  }
};

/// Header and data in the file.
struct BagFile::Record {
  std::vector<std::uint8_t> header;
  std::uint64_t data_at = 0, end = 0;
  std::uint32_t data_size = 0;
};

void BagFile::fail(const std::string& what) const {
  throw Error(name_ + ": " + what);
}

BagFile::BagFile(BagBytes bytes, std::string name) : bytes_(std::move(bytes)), name_(std::move(name)) {
  std::uint64_t at = 0;
  begin(&at);
  while (at < bytes_.size) {
    const Record found = record(at);
    const Header header = headerOf(found.header.data(), found.header.size());
    if (header.op() == Op::chunk) {
      addChunk(header, found);
    } else if (header.op() == Op::connection) {
      std::vector<std::uint8_t> data(found.data_size);
      bytes_.read(found.data_at, reinterpret_cast<char*>(data.data()), data.size());
      addConnection(header, data.data(), data.size());
    }
    at = found.end;
  }
  for (const Entry& entry : entries_) {
    if (connections_.count(entry.connection) == 0) {
      fail("is damaged: a message of an unknown connection");
    }
  }
  std::stable_sort(entries_.begin(), entries_.end(), [](const Entry& a, const Entry& b) {
    return std::pair(a.seconds, a.nanoseconds) < std::pair(b.seconds, b.nanoseconds);
  });
}

/// The line that every bag begins with, and its first record. @param at becomes the place behind them.
void BagFile::begin(std::uint64_t* at) const {
  std::string version(VERSION_SIZE, '\0');
  if (bytes_.size >= version.size()) {
    bytes_.read(0, version.data(), version.size());
  }
  if (version != VERSION_LINE) {
    fail("is no bag of version 2.0");
  }
  const Record first = record(VERSION_SIZE);
  const Header header = headerOf(first.header.data(), first.header.size());
  const std::optional<std::uint32_t> low = header.number("index_pos"), high = header.number("index_pos", 1);
  if (header.op() != Op::bag || !low || !high) {
    fail("is no bag, or damaged: its first record is none");
  }
  if (!header.word("encryptor").empty()) {
    fail("is encrypted");
  }
  if (*low == 0 && *high == 0) {
    fail("the bag has no index: its recording was cut off (rosbag reindex mends it)");
  }
  *at = first.end;
}

BagFile::Record BagFile::record(std::uint64_t at) const {
  const auto length = [&](std::uint64_t place) {
    std::uint8_t bytes[LENGTH];
    if (bytes_.size - place < LENGTH) {
      fail("cannot be read as a bag: missing, or cut off");
    }
    bytes_.read(place, reinterpret_cast<char*>(bytes), LENGTH);
    const std::uint32_t size = numberAt(bytes);
    if (size > bytes_.size) {
      fail("is no bag, or damaged: a record tells of " + std::to_string(size) + " bytes");
    }
    if (size > bytes_.size - place - LENGTH) {
      fail("cannot be read as a bag: missing, or cut off");
    }
    return size;
  };
  Record found;
  found.header.resize(length(at));
  bytes_.read(at + LENGTH, reinterpret_cast<char*>(found.header.data()), found.header.size());
  const std::uint64_t middle = at + LENGTH + found.header.size();
  found.data_size = length(middle);
  found.data_at = middle + LENGTH;
  found.end = found.data_at + found.data_size;
  return found;
}

BagFile::Header BagFile::headerOf(const std::uint8_t* data, std::size_t size) const {
  const char* const begin = reinterpret_cast<const char*>(data);
  for (std::size_t at = 0; at < size; at += LENGTH + numberAt(begin + at)) {
    if (!Header::whole(begin + at, size - at)) {
      fail("is damaged: a record's header does not hold what it says");
    }
  }
  return {begin, size};
}

void BagFile::addConnection(const Header& header, const std::uint8_t* data, std::size_t size) {
  const std::optional<std::uint32_t> number = header.number("conn");
  const Header more = headerOf(data, size);
  if (!number) {
    fail("is damaged: a connection without a number");
  }
  connections_.emplace(*number, Connection{header.word("topic"), more.word("type"), more.word("md5sum")});
}

void BagFile::addChunk(const Header& header, const Record& record) {
  Chunk chunk;
  chunk.at = record.data_at;
  chunk.stored = record.data_size;
  const std::string packing = header.word("compression");
  const std::optional<std::uint32_t> size = header.number("size");
  std::uint64_t most = chunk.stored;
  if (packing == "bz2") {
    chunk.packing = Chunk::Packing::bz2;
    most = chunk.stored * BZ2_MOST + SLACK;
  } else if (packing == "lz4") {
    chunk.packing = Chunk::Packing::lz4;
    most = chunk.stored * LZ4_MOST + SLACK;
  } else if (packing != "none") {
    fail("is damaged: a chunk that is packed as '" + packing + "'");
  }
  if (!size || *size > most) {
    fail("is damaged: a chunk of " + std::to_string(chunk.stored) + " bytes tells of " +
         std::to_string(size.value_or(0)));
  }
  chunk.size = *size;
  chunks_.push_back(chunk);
  index(static_cast<std::uint32_t>(chunks_.size() - 1));
}

/// Finds the messages and connections in a chunk.
void BagFile::index(std::uint32_t number) {
  const std::vector<std::uint8_t>& bytes = load(number);
  for (std::size_t at = 0; at < bytes.size();) {
    std::size_t begins[2]{}, sizes[2]{};  // of header and data
    for (int part = 0; part < 2; ++part) {
      const std::size_t left = bytes.size() - at;
      sizes[part] = left < LENGTH ? 0 : numberAt(&bytes[at]);
      if (left < LENGTH || sizes[part] > left - LENGTH) {
        fail("is damaged: a record in a chunk is longer than the chunk");
      }
      begins[part] = at + LENGTH;
      at += LENGTH + sizes[part];
    }
    const Header header = headerOf(bytes.data() + begins[0], sizes[0]);
    if (header.op() == Op::connection) {
      addConnection(header, bytes.data() + begins[1], sizes[1]);
    } else if (header.op() == Op::message) {
      const auto connection = header.number("conn"), seconds = header.number("time"),
                 nanoseconds = header.number("time", 1);
      if (!connection || !seconds || !nanoseconds || *nanoseconds >= NANO) {
        fail("is damaged: a message without connection or time");
      }
      entries_.push_back({*seconds, *nanoseconds, number, static_cast<std::uint32_t>(begins[1]),
                          static_cast<std::uint32_t>(sizes[1]), *connection});
    }
  }
}

const std::vector<std::uint8_t>& BagFile::load(std::uint32_t number) {
  const auto kept = std::find_if(loaded_.begin(), loaded_.end(),
                                 [number](const Loaded& loaded) { return loaded.chunk == number; });
  if (kept != loaded_.end()) {
    return kept->bytes;
  }
  Chunk& chunk = chunks_[number];
  // Memory that was used before is at hand already.
  std::vector<std::uint8_t> bytes;
  if (loaded_.size() >= KEPT) {
    bytes = std::move(loaded_.back().bytes);
    loaded_.pop_back();
  }
  bytes.resize(chunk.size);
  stored_.resize(chunk.stored);
  bytes_.read(chunk.at, reinterpret_cast<char*>(stored_.data()), stored_.size());
  try {
    if (chunk.packing == Chunk::Packing::none) {
      bytes.assign(stored_.begin(), stored_.begin() + std::min(chunk.size, chunk.stored));
      bytes.resize(chunk.size);
    } else if (chunk.packing == Chunk::Packing::bz2) {
      rosbag::BZ2Stream(nullptr).decompress(bytes.data(), chunk.size, stored_.data(), chunk.stored);
    } else {
      unpackLz4(stored_, bytes, chunk.seen);
    }
  } catch (const std::exception& e) {
    fail(std::string("is damaged: a chunk cannot be unpacked: ") + e.what());
  }
  chunk.seen = true;
  loaded_.push_front({number, std::move(bytes)});
  return loaded_.front().bytes;
}

const std::uint8_t* BagFile::data(const Entry& entry) {
  return load(entry.chunk).data() + entry.offset;
}

BagBytes bagBytesOf(const std::string& path) {
  const auto file = std::make_shared<std::ifstream>(path, std::ios::binary | std::ios::ate);
  if (!*file || file->tellg() < 0) {
    throw Error(path + ": cannot be read as a bag: missing, or cut off");
  }
  BagBytes bytes;
  bytes.size = static_cast<std::uint64_t>(file->tellg());
  bytes.read = [file, path](std::uint64_t at, char* to, std::size_t count) {
    file->seekg(static_cast<std::streamoff>(at));
    if (!file->read(to, static_cast<std::streamsize>(count))) {
      throw Error(path + ": cannot be read as a bag: missing, or cut off");
    }
  };
  return bytes;
}

}  // namespace smartmill
