#include "mcap_writer.h"

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "bag_writer.h"
#include "checksum.h"
#include "little_endian.h"
#include "mcap_file.h"
#include "output_file.h"
#include "smartmill_core/error.h"

namespace smartmill {
namespace {

constexpr const char* LIBRARY = "smartmill";
const std::string MAGIC(MCAP_MAGIC, MCAP_MAGIC_SIZE);

/// The content of a record.
class Content {
 public:
  template <class Number>
  Content& number(Number value) {
    appendNumber(bytes_, value);
    return *this;
  }
  /// Behind its length of 32 bits.
  Content& text(const std::string& value) {
    number(static_cast<std::uint32_t>(value.size()));
    bytes_ += value;
    return *this;
  }
  Content& raw(const std::string& value) {
    bytes_ += value;
    return *this;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

std::string recordOf(McapOp op, const Content& content) {
  std::string bytes(1, static_cast<char>(op));
  appendNumber(bytes, static_cast<std::uint64_t>(content.bytes().size()));
  return bytes + content.bytes();
}

class McapWriter : public RecordingWriter {
 public:
  McapWriter(const std::string& path, Packing packing) : path_(path), file_(path), packing_(packing) {
    put(MAGIC + recordOf(McapOp::header, Content().text(MCAP_PROFILE).text(LIBRARY)));
  }
  std::uint32_t connect(const RecordedConnection& connection) override;
  void write(std::uint32_t connection, std::uint64_t time, const std::uint8_t* data,
             std::size_t size) override;
  using RecordingWriter::write;
  void close() override;
  std::uint64_t size() const override { return file_.position(); }

 private:
  struct Channel {
    std::uint16_t schema = 0;
    std::string record;
    std::uint64_t count = 0;  // messages
    bool in_file = false;
  };
  struct Schema {
    std::string type, definition, record;
    bool in_file = false;
  };
  struct Place {
    std::uint64_t time, offset;
  };
  /// Of the chunk's messages, or of all.
  struct Span {
    std::uint64_t first = std::numeric_limits<std::uint64_t>::max(), last = 0;
    void add(std::uint64_t time) {
      first = std::min(first, time);
      last = std::max(last, time);
    }
    std::uint64_t begin() const { return std::min(first, last); }  // 0 without messages
  };

  void put(const std::string& bytes);
  static std::uint32_t checksumOf(const std::string& bytes, std::uint32_t before = 0) {
    return crc32(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size(), before);
  }
  std::uint16_t schemaOf(const RecordedConnection& connection);
  void flush();
  void writeSummary();

  std::string path_;
  OutputFile file_;
  std::uint32_t data_checksum_ = 0;
  Packing packing_;
  std::vector<Schema> schemas_;  // number 1 first
  std::vector<Channel> channels_;
  std::string chunk_;
  std::map<std::uint16_t, std::vector<Place>> places_;  // of the chunk's messages
  Span chunk_span_, span_;
  std::uint64_t messages_ = 0;
  std::vector<std::string> chunk_indexes_;  // their records
};

/// In the data section, of which the checksum is written behind it.
void McapWriter::put(const std::string& bytes) {
  file_.write(bytes);
  data_checksum_ = checksumOf(bytes, data_checksum_);
}

/// 0 where neither type nor definition is known.
std::uint16_t McapWriter::schemaOf(const RecordedConnection& connection) {
  if (connection.type.empty() && connection.definition.empty()) return 0;
  const auto known = std::find_if(schemas_.begin(), schemas_.end(), [&](const Schema& schema) {
    return schema.type == connection.type && schema.definition == connection.definition;
  });
  if (known != schemas_.end()) return static_cast<std::uint16_t>(known - schemas_.begin() + 1);
  const auto number = static_cast<std::uint16_t>(schemas_.size() + 1);
  schemas_.push_back({connection.type, connection.definition,
                      recordOf(McapOp::schema, Content()
                                                   .number(number)
                                                   .text(connection.type)
                                                   .text(MCAP_SCHEMA_ENCODING)
                                                   .text(connection.definition))});
  return number;
}

std::uint32_t McapWriter::connect(const RecordedConnection& connection) {
  if (channels_.size() >= std::numeric_limits<std::uint16_t>::max())
    throw Error(path_ + ": expected at most 65535 channels in an MCAP file");
  if (connection.encoding != MCAP_MESSAGE_ENCODING)
    throw Error(path_ + ": topic " + connection.topic + " is encoded as " + connection.encoding +
                ", expected ros1");
  const auto number = static_cast<std::uint16_t>(channels_.size());
  Content metadata;
  for (const auto& [name, value] : connection.more) metadata.text(name).text(value);
  metadata.text("md5sum").text(connection.md5sum);
  Channel channel;
  channel.schema = schemaOf(connection);
  channel.record = recordOf(McapOp::channel, Content()
                                                 .number(number)
                                                 .number(channel.schema)
                                                 .text(connection.topic)
                                                 .text(MCAP_MESSAGE_ENCODING)
                                                 .text(metadata.bytes()));
  channels_.push_back(channel);
  return number;
}

void McapWriter::write(std::uint32_t connection, std::uint64_t time, const std::uint8_t* data,
                       std::size_t size) {
  Channel& channel = channels_.at(connection);
  const auto number = static_cast<std::uint16_t>(connection);
  if (!channel.in_file) {
    channel.in_file = true;
    if (channel.schema != 0 && !std::exchange(schemas_[channel.schema - 1U].in_file, true))
      chunk_ += schemas_[channel.schema - 1U].record;
    chunk_ += channel.record;
  }
  places_[number].push_back({time, chunk_.size()});
  chunk_span_.add(time);
  span_.add(time);
  ++messages_;
  chunk_ += recordOf(McapOp::message, Content()
                                          .number(number)
                                          .number(static_cast<std::uint32_t>(channel.count++))
                                          .number(time)
                                          .number(time)
                                          .raw(std::string(reinterpret_cast<const char*>(data), size)));
  if (chunk_.size() >= CHUNK_TARGET) flush();
}

void McapWriter::flush() {
  if (chunk_.empty()) return;
  const std::string packed = pack(packing_, chunk_);
  const std::string packing = packing_ == Packing::zstd ? "zstd" : packing_ == Packing::lz4 ? "lz4" : "";
  const auto size = static_cast<std::uint64_t>(chunk_.size()),
             stored = static_cast<std::uint64_t>(packed.size());
  const std::string record = recordOf(McapOp::chunk, Content()
                                                         .number(chunk_span_.begin())
                                                         .number(chunk_span_.last)
                                                         .number(size)
                                                         .number(checksumOf(chunk_))
                                                         .text(packing)
                                                         .number(stored)
                                                         .raw(packed));
  const std::uint64_t begin = file_.position();
  put(record);
  const std::uint64_t index_begin = file_.position();
  Content offsets;
  for (const auto& [channel, places] : places_) {
    offsets.number(channel).number(file_.position());
    Content entries;
    for (const Place& place : places) entries.number(place.time).number(place.offset);
    put(recordOf(McapOp::message_index, Content().number(channel).text(entries.bytes())));
  }
  chunk_indexes_.push_back(
      recordOf(McapOp::chunk_index, Content()
                                        .number(chunk_span_.begin())
                                        .number(chunk_span_.last)
                                        .number(begin)
                                        .number(static_cast<std::uint64_t>(record.size()))
                                        .text(offsets.bytes())
                                        .number(file_.position() - index_begin)
                                        .text(packing)
                                        .number(stored)
                                        .number(size)));
  chunk_.clear();
  places_.clear();
  chunk_span_ = {};
  file_.flush();  // what is complete outlives this program
}

void McapWriter::close() {
  // Channels without a message are kept too.
  for (Channel& channel : channels_) {
    if (std::exchange(channel.in_file, true)) continue;
    if (channel.schema != 0 && !std::exchange(schemas_[channel.schema - 1U].in_file, true))
      chunk_ += schemas_[channel.schema - 1U].record;
    chunk_ += channel.record;
  }
  flush();
  file_.write(recordOf(McapOp::data_end, Content().number(data_checksum_)));
  writeSummary();
  file_.write(MAGIC);
  file_.close();
}

void McapWriter::writeSummary() {
  const std::uint64_t begin = file_.position();
  std::string summary, offsets;
  const auto group = [&](McapOp op, const std::string& records) {
    if (records.empty()) return;
    offsets +=
        recordOf(McapOp::summary_offset, Content()
                                             .number(static_cast<std::uint8_t>(op))
                                             .number(static_cast<std::uint64_t>(begin + summary.size()))
                                             .number(static_cast<std::uint64_t>(records.size())));
    summary += records;
  };
  std::string schemas, channels, chunks;
  Content counts;
  for (const Schema& schema : schemas_) schemas += schema.record;
  for (std::size_t i = 0; i < channels_.size(); ++i) {
    channels += channels_[i].record;
    counts.number(static_cast<std::uint16_t>(i)).number(channels_[i].count);
  }
  for (const std::string& index : chunk_indexes_) chunks += index;
  group(McapOp::schema, schemas);
  group(McapOp::channel, channels);
  group(McapOp::statistics,
        recordOf(McapOp::statistics, Content()
                                         .number(messages_)
                                         .number(static_cast<std::uint16_t>(schemas_.size()))
                                         .number(static_cast<std::uint32_t>(channels_.size()))
                                         .number(std::uint32_t{0})
                                         .number(std::uint32_t{0})
                                         .number(static_cast<std::uint32_t>(chunk_indexes_.size()))
                                         .number(span_.begin())
                                         .number(span_.last)
                                         .text(counts.bytes())));
  group(McapOp::chunk_index, chunks);
  // The footer's checksum is of everything from the summary up to itself.
  const std::string footer =
      recordOf(McapOp::footer, Content()
                                   .number(begin)
                                   .number(static_cast<std::uint64_t>(begin + summary.size()))
                                   .number(std::uint32_t{0}));
  std::string bytes = summary + offsets + footer;
  bytes.resize(bytes.size() - sizeof(std::uint32_t));
  appendNumber(bytes, checksumOf(bytes));
  file_.write(bytes);
}

}  // namespace

std::unique_ptr<RecordingWriter> createMcap(const std::string& path, Packing packing) {
  return std::make_unique<McapWriter>(path, packing);
}

}  // namespace smartmill
