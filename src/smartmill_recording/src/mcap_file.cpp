#include "mcap_file.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

#include "checksum.h"
#include "chunked_file.h"
#include "little_endian.h"
#include "message_definition.h"

namespace smartmill {
namespace {

constexpr std::uint64_t MOST_TOGETHER = 4U << 20U;  // [byte] of messages outside chunks that are read at once
constexpr std::size_t CHECKED_AT_ONCE = 1U << 20U;  // [byte]
constexpr std::size_t CHUNK_HEAD = 8 + 8 + 8 + 4 + 4;  // [byte] up to the length of its compression's name
constexpr std::size_t FOOTER_SIZE = 8 + 8 + 4;

struct Schema {
  std::string name, encoding, data;
};

struct Channel {
  std::uint16_t schema = 0;
  std::string topic, encoding;
  std::map<std::string, std::string> metadata;
};

bool operator!=(const Channel& a, const Channel& b) {
  return a.schema != b.schema || a.topic != b.topic || a.encoding != b.encoding || a.metadata != b.metadata;
}

bool operator!=(const Schema& a, const Schema& b) {
  return a.name != b.name || a.encoding != b.encoding || a.data != b.data;
}

struct Statistics {
  std::uint64_t messages = 0;
  std::uint32_t channels = 0, chunks = 0;
};

/// Head of a record in the file.
struct Record {
  McapOp op;
  std::uint64_t begin, at, size;  // of the record, of its content; [byte] content
  std::uint64_t end() const { return at + size; }
};

class McapFile : public ChunkedFile {
 public:
  McapFile(RecordingBytes bytes, std::string name, RecordingEnd end);

 private:
  /// Fields of one record, one after the other.
  class Fields {
   public:
    Fields(const McapFile& file, const std::uint8_t* data, std::size_t size)
        : file_(file), at_(data), left_(size) {}
    template <class Number>
    Number number() {
      return numberAt<Number>(take(sizeof(Number)));
    }
    std::string text() {
      const auto size = number<std::uint32_t>();
      const auto* const begin = reinterpret_cast<const char*>(take(size));
      return std::string(begin, size);
    }
    std::map<std::string, std::string> map() {
      const auto size = number<std::uint32_t>();
      Fields inner(file_, take(size), size);
      std::map<std::string, std::string> values;
      while (inner.left_ > 0) {
        const std::string key = inner.text();
        values[key] = inner.text();
      }
      return values;
    }
    const std::uint8_t* take(std::size_t size) {
      if (size > left_)
        file_.fail("is damaged: a field of " + std::to_string(size) + " bytes in a record with " +
                   std::to_string(left_) + " left");
      const std::uint8_t* const begin = at_;
      at_ += size;
      left_ -= size;
      return begin;
    }

   private:
    const McapFile& file_;
    const std::uint8_t* at_;
    std::size_t left_;
  };

  Record record(std::uint64_t at) const;
  bool isWhole(std::uint64_t at) const;
  void scan();
  void checkFooter(const Record& footer, std::uint64_t summary) const;
  std::uint32_t checksumOf(std::uint64_t begin, std::uint64_t end) const;
  void addLoose(const Record& record);
  void addChunk(const Record& record);
  void declare(McapOp op, const std::uint8_t* data, std::size_t size);
  void connect(std::uint32_t number, const Channel& channel);
  void index(std::uint32_t number, const std::vector<std::uint8_t>& bytes) override;
  void checkEnd(std::size_t messages) const override;

  std::map<std::uint16_t, Schema> schemas_;
  std::map<std::uint16_t, Channel> channels_;
  std::optional<Statistics> statistics_;
  std::uint64_t loose_end_ = 0;  // behind the last message outside a chunk
  bool connected_ = false;       // all channels that were found before the first message
  bool any_loose_ = false;
};

McapFile::McapFile(RecordingBytes bytes, std::string name, RecordingEnd end)
    : ChunkedFile(std::move(bytes), std::move(name), end) {
  scan();
  finishChunks();
  if (statistics_ && statistics_->chunks != 0 && chunks_.empty())
    fail("is damaged: its statistics state " + std::to_string(statistics_->chunks) +
         " chunks, none is there");
  // Without a copy of the channels in the summary they are in the chunks alone.
  if (!statistics_ || statistics_->channels != channels_.size()) survey();
  for (const auto& [number, channel] : channels_) connect(number, channel);
  connected_ = true;
  if (chunks_.empty()) checkEnd(0);
}

Record McapFile::record(std::uint64_t at) const {
  const auto where = [&] { return " at byte " + std::to_string(at) + " of " + std::to_string(bytes_.size); };
  if (bytes_.size - at < MCAP_RECORD_HEAD)
    fail("is cut off" + where() + ": expected a record, the last one a footer");
  std::uint8_t head[MCAP_RECORD_HEAD];
  copy(at, head, sizeof head);
  const Record found{static_cast<McapOp>(head[0]), at, at + MCAP_RECORD_HEAD,
                     numberAt<std::uint64_t>(head + 1)};
  if (found.size > bytes_.size - found.at)
    fail("is cut off or damaged" + where() + ": a record states " + std::to_string(found.size) + " bytes");
  return found;
}

/// Whether a whole record begins there.
bool McapFile::isWhole(std::uint64_t at) const {
  if (bytes_.size - at < MCAP_RECORD_HEAD) return false;
  std::uint8_t head[MCAP_RECORD_HEAD];
  copy(at, head, sizeof head);
  return numberAt<std::uint64_t>(head + 1) <= bytes_.size - at - MCAP_RECORD_HEAD;
}

/// Goes through the records without reading the chunks.
void McapFile::scan() {
  Record found = record(MCAP_MAGIC_SIZE);
  if (found.op != McapOp::header) fail("is damaged: its first record is not a header");
  std::optional<std::uint64_t> summary;
  while (found.op != McapOp::footer) {
    const std::uint64_t next = found.end();
    if (end_ == RecordingEnd::any && !isWhole(next)) {
      left_out_ = bytes_.size - next;
      return;
    }
    found = record(next);
    const bool in_data = !summary;
    if (found.op == McapOp::schema || found.op == McapOp::channel || found.op == McapOp::statistics ||
        found.op == McapOp::data_end) {
      const std::string content = textAt(found.at, static_cast<std::size_t>(found.size));
      const auto* const data = reinterpret_cast<const std::uint8_t*>(content.data());
      Fields fields(*this, data, content.size());
      if (found.op == McapOp::data_end) {
        const auto checksum = fields.number<std::uint32_t>();
        summary = found.end();
        // Chunks have checksums of their own; messages outside have none.
        if (any_loose_ && checksum != 0 && checksumOf(0, found.begin) != checksum)
          fail("is damaged: checksum mismatch of its data section");
      } else if (found.op == McapOp::statistics) {
        Statistics statistics;
        statistics.messages = fields.number<std::uint64_t>();
        fields.number<std::uint16_t>();  // schemas
        statistics.channels = fields.number<std::uint32_t>();
        fields.number<std::uint32_t>();  // attachments
        fields.number<std::uint32_t>();  // metadata
        statistics.chunks = fields.number<std::uint32_t>();
        statistics_ = statistics;
      } else {
        declare(found.op, data, content.size());
      }
    } else if (in_data && found.op == McapOp::message) {
      addLoose(found);
    } else if (in_data && found.op == McapOp::chunk) {
      addChunk(found);
    } else if (in_data && found.op == McapOp::footer) {
      fail("is damaged: expected the end of its data section before the footer");
    }
  }
  checkFooter(found, *summary);
}

/// @param summary position behind the data section
void McapFile::checkFooter(const Record& footer, std::uint64_t summary) const {
  const std::string content =
      textAt(footer.at, static_cast<std::size_t>(std::min<std::uint64_t>(footer.size, FOOTER_SIZE)));
  Fields fields(*this, reinterpret_cast<const std::uint8_t*>(content.data()), content.size());
  const auto start = fields.number<std::uint64_t>();
  fields.number<std::uint64_t>();  // of the summary's offsets
  const auto checksum = fields.number<std::uint32_t>();
  if (footer.end() + MCAP_MAGIC_SIZE != bytes_.size || textAt(footer.end(), MCAP_MAGIC_SIZE) != MCAP_MAGIC)
    fail("is damaged: expected the MCAP magic bytes behind the footer, at byte " +
         std::to_string(footer.end()));
  if (start != 0 && start != summary)
    fail("is damaged: its footer states a summary at byte " + std::to_string(start) + ", expected " +
         std::to_string(summary));
  if (checksum != 0 &&
      checksumOf(start == 0 ? footer.begin : start, footer.at + FOOTER_SIZE - sizeof checksum) != checksum)
    fail("is damaged: checksum mismatch of its summary");
}

std::uint32_t McapFile::checksumOf(std::uint64_t begin, std::uint64_t end) const {
  std::vector<std::uint8_t> bytes;
  std::uint32_t checksum = 0;
  while (begin < end) {
    bytes.resize(static_cast<std::size_t>(std::min<std::uint64_t>(CHECKED_AT_ONCE, end - begin)));
    bytes_.read(begin, reinterpret_cast<char*>(bytes.data()), bytes.size());
    checksum = crc32(bytes.data(), bytes.size(), checksum);
    begin += bytes.size();
  }
  return checksum;
}

/// A message outside the chunks; neighbours are read together, as a chunk that is not packed.
void McapFile::addLoose(const Record& found) {
  any_loose_ = true;
  if (found.size < MCAP_MESSAGE_HEAD || found.end() - found.begin > std::numeric_limits<std::uint32_t>::max())
    fail("is damaged: a message record of " + std::to_string(found.size) + " bytes at byte " +
         std::to_string(found.begin));
  std::uint8_t head[MCAP_MESSAGE_HEAD];
  copy(found.at, head, sizeof head);
  const auto time = numberAt<std::uint64_t>(head + 6);
  const std::uint64_t size = found.end() - found.begin;
  if (chunks_.empty() || loose_end_ != found.begin || chunks_.back().stored + size > MOST_TOGETHER) {
    Chunk chunk;
    chunk.begin = chunk.at = found.begin;
    chunk.first = time;
    chunks_.push_back(chunk);
  }
  Chunk& chunk = chunks_.back();
  chunk.first = std::min(chunk.first, time);
  chunk.stored += size;
  chunk.size = static_cast<std::uint32_t>(chunk.stored);
  loose_end_ = found.end();
}

void McapFile::addChunk(const Record& found) {
  const std::string head =
      textAt(found.at, static_cast<std::size_t>(std::min<std::uint64_t>(found.size, CHUNK_HEAD)));
  Fields fields(*this, reinterpret_cast<const std::uint8_t*>(head.data()), head.size());
  Chunk chunk;
  chunk.begin = found.begin;
  chunk.first = fields.number<std::uint64_t>();
  fields.number<std::uint64_t>();  // of the last message
  const auto size = fields.number<std::uint64_t>();
  chunk.checksum = fields.number<std::uint32_t>();
  const auto name = fields.number<std::uint32_t>();
  constexpr std::uint64_t LENGTH = sizeof(std::uint64_t);
  const auto where = [&] { return ": the chunk at byte " + std::to_string(found.begin); };
  if (found.size < CHUNK_HEAD + LENGTH || name > found.size - CHUNK_HEAD - LENGTH)
    fail("is damaged" + where() + " states a compression of " + std::to_string(name) + " letters");
  const std::string tail = textAt(found.at + CHUNK_HEAD, name + LENGTH);
  const std::string packing = tail.substr(0, name);
  chunk.stored = numberAt<std::uint64_t>(tail.data() + name);
  chunk.at = found.at + CHUNK_HEAD + name + LENGTH;
  if (chunk.stored > found.end() - chunk.at)
    fail("is damaged" + where() + " states " + std::to_string(chunk.stored) + " bytes of records");
  if (packing == "zstd") {
    chunk.packing = Packing::zstd;
  } else if (packing == "lz4") {
    chunk.packing = Packing::lz4;
  } else if (!packing.empty()) {
    fail("is damaged" + where() + " is compressed by '" + packing + "', expected zstd, lz4 or nothing");
  }
  if (size > std::numeric_limits<std::uint32_t>::max() || (packing.empty() && size != chunk.stored))
    fail("is damaged" + where() + " of " + std::to_string(chunk.stored) + " bytes states " +
         std::to_string(size));
  chunk.size = static_cast<std::uint32_t>(size);
  chunks_.push_back(chunk);
}

/// A schema or a channel, wherever it occurs.
void McapFile::declare(McapOp op, const std::uint8_t* data, std::size_t size) {
  Fields fields(*this, data, size);
  const auto number = fields.number<std::uint16_t>();
  if (op == McapOp::schema) {
    Schema schema;
    schema.name = fields.text();
    schema.encoding = fields.text();
    schema.data = fields.text();
    if (number != 0 && schemas_.emplace(number, schema).first->second != schema)
      fail("is damaged: two different schemas have number " + std::to_string(number));
    return;
  }
  Channel channel;
  channel.schema = fields.number<std::uint16_t>();
  channel.topic = fields.text();
  channel.encoding = fields.text();
  channel.metadata = fields.map();
  const auto [known, is_new] = channels_.emplace(number, channel);
  if (known->second != channel)
    fail("is damaged: two different channels have number " + std::to_string(number));
  if (is_new && connected_) connect(number, channel);
}

void McapFile::connect(std::uint32_t number, const Channel& channel) {
  RecordedConnection connection;
  connection.topic = channel.topic;
  connection.encoding = channel.encoding;
  connection.more = channel.metadata;
  const auto schema = schemas_.find(channel.schema);
  if (schema != schemas_.end()) {
    connection.type = schema->second.name;
    if (schema->second.encoding == MCAP_SCHEMA_ENCODING) connection.definition = schema->second.data;
  }
  const auto sum = connection.more.find("md5sum");
  if (sum != connection.more.end()) {
    connection.md5sum = sum->second;
    connection.more.erase(sum);
  } else {
    connection.md5sum = definitionMd5(connection.type, connection.definition);
  }
  connections_.emplace(number, std::move(connection));
}

void McapFile::index(std::uint32_t number, const std::vector<std::uint8_t>& bytes) {
  for (std::size_t at = 0; at < bytes.size();) {
    const std::size_t left = bytes.size() - at;
    const std::uint64_t size = left < MCAP_RECORD_HEAD ? 0 : numberAt<std::uint64_t>(&bytes[at + 1]);
    if (left < MCAP_RECORD_HEAD || size > left - MCAP_RECORD_HEAD)
      fail("is damaged: a record in the chunk at byte " + std::to_string(chunks_[number].begin) +
           " is longer than the chunk");
    const auto op = static_cast<McapOp>(bytes[at]);
    const std::uint8_t* const data = bytes.data() + at + MCAP_RECORD_HEAD;
    if (op == McapOp::schema || op == McapOp::channel) {
      declare(op, data, static_cast<std::size_t>(size));
    } else if (op == McapOp::message && !surveying_) {
      Fields fields(*this, data, static_cast<std::size_t>(size));
      Entry entry;
      entry.connection = fields.number<std::uint16_t>();
      fields.number<std::uint32_t>();  // sequence
      entry.time = fields.number<std::uint64_t>();
      fields.number<std::uint64_t>();  // of publishing
      entry.chunk = number;
      entry.offset = static_cast<std::uint32_t>(at + MCAP_RECORD_HEAD + MCAP_MESSAGE_HEAD);
      entry.size = static_cast<std::uint32_t>(size - MCAP_MESSAGE_HEAD);
      addMessage(entry);
    }
    at += MCAP_RECORD_HEAD + static_cast<std::size_t>(size);
  }
}

/// A record whose code is damaged is skipped as an unknown one; it is then missing from the statistics.
void McapFile::checkEnd(std::size_t messages) const {
  if (statistics_ && statistics_->messages != messages)
    fail("is damaged: its statistics state " + std::to_string(statistics_->messages) + " messages, " +
         std::to_string(messages) + " are there");
}

}  // namespace

std::unique_ptr<RecordingFile> openMcap(RecordingBytes bytes, const std::string& name, RecordingEnd end) {
  return std::make_unique<McapFile>(std::move(bytes), name, end);
}

}  // namespace smartmill
