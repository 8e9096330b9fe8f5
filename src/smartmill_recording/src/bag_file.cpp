#include "bag_file.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <string_view>
#include <utility>

#include "chunked_file.h"
#include "little_endian.h"

namespace smartmill {
namespace {

constexpr std::size_t VERSION_SIZE = 13;  // [byte]
constexpr std::size_t LENGTH = 4;         // [byte] of a record's lengths
constexpr std::uint32_t NANO = 1000000000;

std::uint64_t nanoseconds(std::uint32_t seconds, std::uint32_t rest) {
  return std::uint64_t{NANO} * seconds + rest;
}

/// name=value fields, in place.
struct Header {
  const char* data;
  std::size_t size;

  /// The bytes that are left begin with a whole field.
  static bool whole(const char* at, std::size_t left) {
    return left >= LENGTH && numberAt<std::uint32_t>(at) <= left - LENGTH;
  }
  template <class Use>
  void each(Use use) const {
    for (std::size_t at = 0; at < size;) {
      const std::string_view field(data + at + LENGTH, numberAt<std::uint32_t>(data + at));
      const std::size_t sign = field.find('=');
      if (sign != std::string_view::npos && use(field.substr(0, sign), field.substr(sign + 1))) return;
      at += LENGTH + field.size();
    }
  }
  /// The value of a field; the first, where a name occurs twice.
  std::optional<std::string_view> find(std::string_view name) const {
    std::optional<std::string_view> found;
    each([&](std::string_view key, std::string_view value) {
      if (key != name) return false;
      found = value;
      return true;
    });
    return found;
  }
  std::optional<std::uint32_t> number(std::string_view name, std::size_t place = 0) const {
    const std::optional<std::string_view> value = find(name);
    if (!value || value->size() < 4 * (place + 1)) return std::nullopt;
    return numberAt<std::uint32_t>(value->data() + 4 * place);
  }
  std::string word(std::string_view name) const { return std::string(find(name).value_or("")); }
  BagOp op() const {
    const std::optional<std::string_view> code = find("op");
    return static_cast<BagOp>(code && code->size() == 1 ? static_cast<unsigned char>(code->front()) : 0);
  }
};

/// Header and data in the file.
struct Record {
  std::vector<std::uint8_t> header;
  std::uint64_t begin = 0, data_at = 0, end = 0;
  std::uint32_t data_size = 0;
};

class BagFile : public ChunkedFile {
 public:
  BagFile(RecordingBytes bytes, std::string name, RecordingEnd end);

 private:
  Record record(std::uint64_t at) const;
  Header headerOf(const std::uint8_t* data, std::size_t size) const;
  bool isWhole(std::uint64_t at) const;
  bool begin(std::uint64_t* at) const;
  void addConnection(const Header& header, const std::uint8_t* data, std::size_t size);
  void addChunk(const Header& header, const Record& record);
  void index(std::uint32_t number, const std::vector<std::uint8_t>& bytes) override;
  void addMessageOf(const Header& header, Entry entry);
};

BagFile::BagFile(RecordingBytes bytes, std::string name, RecordingEnd end)
    : ChunkedFile(std::move(bytes), std::move(name), end) {
  std::uint64_t at = 0;
  const bool has_index = begin(&at);
  std::map<std::uint64_t, std::uint64_t> stated;  // [ns] first time of each chunk by its position
  while (at < bytes_.size) {
    if (!has_index && !isWhole(at)) {
      left_out_ = bytes_.size - at;
      break;
    }
    const Record found = record(at);
    const Header header = headerOf(found.header.data(), found.header.size());
    if (header.op() == BagOp::chunk) {
      addChunk(header, found);
    } else if (header.op() == BagOp::connection) {
      std::vector<std::uint8_t> data(found.data_size);
      bytes_.read(found.data_at, reinterpret_cast<char*>(data.data()), data.size());
      addConnection(header, data.data(), data.size());
    } else if (header.op() == BagOp::chunk_info) {
      const auto low = header.number("chunk_pos"), high = header.number("chunk_pos", 1),
                 seconds = header.number("start_time"), rest = header.number("start_time", 1);
      if (low && high && seconds && rest)
        stated[*low | static_cast<std::uint64_t>(*high) << 32U] = nanoseconds(*seconds, *rest);
    }
    at = found.end;
  }
  // A chunk of which the index states nothing may hold the oldest message of all.
  for (Chunk& chunk : chunks_) {
    const auto first = stated.find(chunk.begin);
    chunk.first = first == stated.end() ? 0 : first->second;
  }
  if (!has_index) {
    for (Chunk& chunk : chunks_) chunk.first = std::numeric_limits<std::uint64_t>::max();
    survey();
  }
  finishChunks();
}

/// The line that every bag begins with, and its first record. @param at becomes the position behind them.
/// @return whether the bag has an index
bool BagFile::begin(std::uint64_t* at) const {
  const Record first = record(VERSION_SIZE);
  const Header header = headerOf(first.header.data(), first.header.size());
  const std::optional<std::uint32_t> low = header.number("index_pos"), high = header.number("index_pos", 1);
  if (header.op() != BagOp::bag || !low || !high) fail("is damaged: its first record is not a bag header");
  if (!header.word("encryptor").empty()) fail("is encrypted");
  const bool has_index = *low != 0 || *high != 0;
  if (!has_index && end_ == RecordingEnd::index)
    fail("the bag has no index: its recording was cut off (smartmill convert copies what is complete)");
  *at = first.end;
  return has_index;
}

/// Whether a whole record begins there.
bool BagFile::isWhole(std::uint64_t at) const {
  for (int part = 0; part < 2; ++part) {  // header and data
    std::uint8_t bytes[LENGTH];
    if (bytes_.size - at < LENGTH) return false;
    copy(at, bytes, LENGTH);
    const auto size = numberAt<std::uint32_t>(bytes);
    if (size > bytes_.size - at - LENGTH) return false;
    at += LENGTH + size;
  }
  return true;
}

Record BagFile::record(std::uint64_t at) const {
  const auto length = [&](std::uint64_t place) {
    std::uint8_t bytes[LENGTH];
    const std::string where =
        ": a record at byte " + std::to_string(at) + " of " + std::to_string(bytes_.size);
    if (bytes_.size - place < LENGTH) fail("is cut off" + where + " has no length");
    copy(place, bytes, LENGTH);
    const auto size = numberAt<std::uint32_t>(bytes);
    if (size > bytes_.size - place - LENGTH)
      fail((size > bytes_.size ? "is damaged" : "is cut off") + where + " states " + std::to_string(size) +
           " bytes");
    return size;
  };
  Record found;
  found.begin = at;
  found.header.resize(length(at));
  copy(at + LENGTH, found.header.data(), found.header.size());
  const std::uint64_t middle = at + LENGTH + found.header.size();
  found.data_size = length(middle);
  found.data_at = middle + LENGTH;
  found.end = found.data_at + found.data_size;
  return found;
}

Header BagFile::headerOf(const std::uint8_t* data, std::size_t size) const {
  const char* const begin = reinterpret_cast<const char*>(data);
  for (std::size_t at = 0; at < size; at += LENGTH + numberAt<std::uint32_t>(begin + at)) {
    if (!Header::whole(begin + at, size - at)) fail("is damaged: a field is longer than its record's header");
  }
  return {begin, size};
}

void BagFile::addConnection(const Header& header, const std::uint8_t* data, std::size_t size) {
  const std::optional<std::uint32_t> number = header.number("conn");
  const Header fields = headerOf(data, size);
  if (!number) fail("is damaged: a connection without a number");
  RecordedConnection connection;
  connection.topic = header.word("topic");
  fields.each([&](std::string_view key, std::string_view value) {
    std::string& place = key == "type"                 ? connection.type
                         : key == "md5sum"             ? connection.md5sum
                         : key == "message_definition" ? connection.definition
                                                       : connection.more[std::string(key)];
    if (place.empty()) place = value;
    return false;
  });
  connection.more.erase("topic");
  connections_.emplace(*number, std::move(connection));
}

void BagFile::addChunk(const Header& header, const Record& record) {
  Chunk chunk;
  chunk.begin = record.begin;
  chunk.at = record.data_at;
  chunk.stored = record.data_size;
  const std::string packing = header.word("compression");
  const std::optional<std::uint32_t> size = header.number("size");
  if (packing == "bz2") {
    chunk.packing = Packing::bz2;
  } else if (packing == "lz4") {
    chunk.packing = Packing::lz4;
  } else if (packing != "none") {
    fail("is damaged: chunk compression '" + packing + "', expected none, bz2 or lz4");
  }
  if (!size || (chunk.packing == Packing::none && *size != chunk.stored))
    fail("is damaged: a chunk of " + std::to_string(chunk.stored) + " bytes states " +
         std::to_string(size.value_or(0)));
  chunk.size = *size;
  chunks_.push_back(chunk);
}

/// Finds the messages and connections in a chunk.
void BagFile::index(std::uint32_t number, const std::vector<std::uint8_t>& bytes) {
  for (std::size_t at = 0; at < bytes.size();) {
    std::size_t begins[2]{}, sizes[2]{};  // of header and data
    for (int part = 0; part < 2; ++part) {
      const std::size_t left = bytes.size() - at;
      sizes[part] = left < LENGTH ? 0 : numberAt<std::uint32_t>(&bytes[at]);
      if (left < LENGTH || sizes[part] > left - LENGTH)
        fail("is damaged: a record in a chunk is longer than the chunk");
      begins[part] = at + LENGTH;
      at += LENGTH + sizes[part];
    }
    const Header header = headerOf(bytes.data() + begins[0], sizes[0]);
    if (header.op() == BagOp::connection) {
      addConnection(header, bytes.data() + begins[1], sizes[1]);
    } else if (header.op() == BagOp::message) {
      Entry place;
      place.chunk = number;
      place.offset = static_cast<std::uint32_t>(begins[1]);
      place.size = static_cast<std::uint32_t>(sizes[1]);
      addMessageOf(header, place);
    }
  }
}

/// @param entry position of its bytes
void BagFile::addMessageOf(const Header& header, Entry entry) {
  const auto connection = header.number("conn"), seconds = header.number("time"),
             rest = header.number("time", 1);
  if (!connection || !seconds || !rest || *rest >= NANO)
    fail("is damaged: a message without connection or time");
  entry.connection = *connection;
  entry.time = nanoseconds(*seconds, *rest);
  if (surveying_) {
    chunks_[entry.chunk].first = std::min(chunks_[entry.chunk].first, entry.time);
  } else {
    addMessage(entry);
  }
}

}  // namespace

std::unique_ptr<RecordingFile> openBag(RecordingBytes bytes, const std::string& name, RecordingEnd end) {
  return std::make_unique<BagFile>(std::move(bytes), name, end);
}

}  // namespace smartmill
