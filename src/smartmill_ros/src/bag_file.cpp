#include "smartmill_ros/bag_file.h"

#include <fcntl.h>
#include <lz4frame.h>
#include <rosbag/stream.h>
#include <unistd.h>
#include <xxhash.h>

#include <algorithm>
#include <cerrno>
#include <limits>
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
constexpr std::size_t LZ4_FLAGS = 4;      // [byte] where a frame's flags stand, behind its magic number
constexpr std::uint32_t NANO = 1000000000;
constexpr std::uint32_t NEVER = std::numeric_limits<std::uint32_t>::max();
constexpr std::size_t WINDOW = 4096;  // [byte]
constexpr std::size_t KEPT = 4;       // chunks, since neighbours overlap in time

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
  // Flags of the frame's descriptor (LZ4 frame format 1.6.2): bit 2 a checksum of the content behind the end
  // mark, bit 4 one behind each block. That of the content is taken by its authors' own library: what the
  // frame's library is built with takes five times as long, most of what unpacking takes.
  const std::uint8_t flags = stored.size() > LZ4_FLAGS ? stored[LZ4_FLAGS] : 0;
  const bool of_content = (flags & 0x04U) != 0U, of_blocks = (flags & 0x10U) != 0U;
  LZ4F_decompressOptions_t options{};
  options.skipChecksums = trusted || (of_content && !of_blocks) ? 1 : 0;
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
  if (trusted || !of_content || of_blocks) return;
  if (from < LENGTH || numberAt(stored.data() + from - LENGTH) != XXH32(bytes.data(), bytes.size(), 0))
    throw std::runtime_error("another checksum than it tells");
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
  std::uint64_t begin = 0, data_at = 0, end = 0;
  std::uint32_t data_size = 0;
};

void BagFile::fail(const std::string& what) const {
  throw Error(name_ + ": " + what);
}

BagFile::BagFile(BagBytes bytes, std::string name) : bytes_(std::move(bytes)), name_(std::move(name)) {
  std::uint64_t at = 0;
  begin(&at);
  std::map<std::uint64_t, Time> told;
  while (at < bytes_.size) {
    const Record found = record(at);
    const Header header = headerOf(found.header.data(), found.header.size());
    if (header.op() == Op::chunk) {
      addChunk(header, found);
    } else if (header.op() == Op::connection) {
      std::vector<std::uint8_t> data(found.data_size);
      bytes_.read(found.data_at, reinterpret_cast<char*>(data.data()), data.size());
      addConnection(header, data.data(), data.size());
    } else if (header.op() == Op::chunk_info) {
      const auto low = header.number("chunk_pos"), high = header.number("chunk_pos", 1),
                 seconds = header.number("start_time"), nanoseconds = header.number("start_time", 1);
      if (low && high && seconds && nanoseconds) {
        told[*low | static_cast<std::uint64_t>(*high) << 32U] = {*seconds, *nanoseconds};
      }
    }
    at = found.end;
  }
  setFirstTimes(told);
  window_.clear();
}

/// A chunk that the index tells nothing of may hold the oldest message of all. @param told by its place
void BagFile::setFirstTimes(const std::map<std::uint64_t, Time>& told) {
  for (Chunk& chunk : chunks_) {
    const auto found = told.find(chunk.begin);
    chunk.first = found == told.end() ? Time() : found->second;
  }
  Time least = {NEVER, NEVER};
  for (auto chunk = chunks_.rbegin(); chunk != chunks_.rend(); ++chunk) {
    chunk->first_behind = least;
    least = std::min(least, chunk->first);
  }
}

bool BagFile::next(Entry* entry) {
  const auto waits = [this] {
    return waiting_.empty() || waiting_.top().time > chunks_[indexed_ - 1].first_behind;
  };
  while (indexed_ < chunks_.size() && waits()) {
    index(indexed_++);
  }
  if (waiting_.empty()) {
    return false;
  }
  *entry = waiting_.top().entry;
  waiting_.pop();
  if (connections_.count(entry->connection) == 0) {
    fail("is damaged: a message of an unknown connection");
  }
  return true;
}

double BagFile::share() const {
  return chunks_.empty() ? 1.0 : static_cast<double>(indexed_) / static_cast<double>(chunks_.size());
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

/// Copies bytes that lie within the file; records of the index are small and stand side by side.
void BagFile::look(std::uint64_t at, std::uint8_t* to, std::size_t count) const {
  if (count > WINDOW) {
    bytes_.read(at, reinterpret_cast<char*>(to), count);
    return;
  }
  if (at < window_at_ || at + count > window_at_ + window_.size()) {
    window_.resize(static_cast<std::size_t>(std::min<std::uint64_t>(WINDOW, bytes_.size - at)));
    bytes_.read(at, reinterpret_cast<char*>(window_.data()), window_.size());
    window_at_ = at;
  }
  std::copy_n(window_.begin() + static_cast<std::ptrdiff_t>(at - window_at_), count, to);
}

BagFile::Record BagFile::record(std::uint64_t at) const {
  const auto length = [&](std::uint64_t place) {
    std::uint8_t bytes[LENGTH];
    if (bytes_.size - place < LENGTH) {
      fail("cannot be read as a bag: missing, or cut off");
    }
    look(place, bytes, LENGTH);
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
  found.begin = at;
  found.header.resize(length(at));
  look(at + LENGTH, found.header.data(), found.header.size());
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
  chunk.begin = record.begin;
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
      Entry place;
      place.chunk = number;
      place.offset = static_cast<std::uint32_t>(begins[1]);
      place.size = static_cast<std::uint32_t>(sizes[1]);
      addMessage(header, place);
    }
  }
}

/// @param place where its bytes are
void BagFile::addMessage(const Header& header, const Entry& place) {
  Entry entry = place;
  const auto connection = header.number("conn"), seconds = header.number("time"),
             nanoseconds = header.number("time", 1);
  if (!connection || !seconds || !nanoseconds || *nanoseconds >= NANO) {
    fail("is damaged: a message without connection or time");
  }
  entry.connection = *connection;
  entry.seconds = *seconds;
  entry.nanoseconds = *nanoseconds;
  const Time time{*seconds, *nanoseconds};
  if (time < chunks_[entry.chunk].first) {
    fail("is damaged: a message that is older than the index tells");
  }
  waiting_.push({time, arrivals_++, entry});
}

/// Memory that was used before is at hand already.
BagFile::Loaded BagFile::spare() {
  Loaded loaded;
  if (loaded_.size() >= KEPT) {
    loaded = std::move(loaded_.back());
    loaded_.pop_back();
  }
  return loaded;
}

/// @throws std::exception
void BagFile::unpack(const Chunk& chunk, Loaded* loaded) const {
  std::vector<std::uint8_t>&bytes = loaded->bytes, &stored = loaded->stored;
  bytes.resize(chunk.size);
  if (chunk.packing == Chunk::Packing::none) {
    bytes_.read(chunk.at, reinterpret_cast<char*>(bytes.data()), bytes.size());
    return;
  }
  stored.resize(chunk.stored);
  bytes_.read(chunk.at, reinterpret_cast<char*>(stored.data()), stored.size());
  if (chunk.packing == Chunk::Packing::bz2) {
    rosbag::BZ2Stream(nullptr).decompress(bytes.data(), chunk.size, stored.data(), chunk.stored);
  } else {
    unpackLz4(stored, bytes, chunk.seen);
  }
}

/// Begins to unpack a chunk that will be asked for.
void BagFile::ahead(std::uint32_t number) {
  if (number >= chunks_.size()) {
    return;
  }
  Loaded loaded = spare();
  loaded.chunk = number;
  coming_ =
      std::async(std::launch::async, [this, chunk = chunks_[number], loaded = std::move(loaded)]() mutable {
        unpack(chunk, &loaded);
        return std::move(loaded);
      });
}

const std::vector<std::uint8_t>& BagFile::load(std::uint32_t number) {
  const auto kept = std::find_if(loaded_.begin(), loaded_.end(),
                                 [number](const Loaded& loaded) { return loaded.chunk == number; });
  if (kept != loaded_.end()) {
    return kept->bytes;
  }
  try {
    // Only next() goes on to a chunk that was never seen.
    if (!chunks_[number].seen && coming_.valid()) {
      loaded_.push_front(coming_.get());
    } else {
      Loaded loaded = spare();
      loaded.chunk = number;
      unpack(chunks_[number], &loaded);
      loaded_.push_front(std::move(loaded));
    }
  } catch (const Error&) {
    throw;
  } catch (const std::exception& e) {
    fail(std::string("is damaged: a chunk cannot be unpacked: ") + e.what());
  }
  if (!chunks_[number].seen) {
    chunks_[number].seen = true;
    ahead(number + 1);
  }
  return loaded_.front().bytes;
}

const std::uint8_t* BagFile::data(const Entry& entry) {
  return load(entry.chunk).data() + entry.offset;
}

BagBytes bagBytesOf(const std::string& path) {
  const auto unread = [path] { return Error(path + ": cannot be read as a bag: missing, or cut off"); };
  const int opened = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  const std::shared_ptr<const int> file(new int(opened), [](const int* number) {
    if (*number >= 0) ::close(*number);
    delete number;
  });
  const off_t size = opened < 0 ? -1 : ::lseek(opened, 0, SEEK_END);
  if (size < 0) {
    throw unread();
  }
  BagBytes bytes;
  bytes.size = static_cast<std::uint64_t>(size);
  bytes.read = [file, unread](std::uint64_t at, char* to, std::size_t count) {
    while (count > 0) {
      const ssize_t got = ::pread(*file, to, count, static_cast<off_t>(at));
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) {
        throw unread();
      }
      at += static_cast<std::uint64_t>(got);
      to += got;
      count -= static_cast<std::size_t>(got);
    }
  };
  return bytes;
}

}  // namespace smartmill
