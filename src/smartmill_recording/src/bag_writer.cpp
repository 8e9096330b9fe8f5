#include "bag_writer.h"

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "bag_file.h"
#include "little_endian.h"
#include "output_file.h"
#include "smartmill_core/error.h"

namespace smartmill {
namespace {

constexpr std::size_t BAG_HEADER_SIZE = 4096;  // [byte] of header and padding, so that it can be rewritten
constexpr std::uint64_t SECOND = 1000000000;   // [ns]
constexpr std::uint32_t INDEX_VERSION = 1;

/// The header of a record.
class Fields {
 public:
  explicit Fields(BagOp op) { add("op", std::string(1, static_cast<char>(op))); }
  Fields() = default;
  Fields& add(const std::string& name, const std::string& value) {
    appendNumber(bytes_, static_cast<std::uint32_t>(name.size() + 1 + value.size()));
    bytes_ += name + "=" + value;
    return *this;
  }
  template <class Number>
  Fields& number(const std::string& name, Number value) {
    std::string bytes;
    appendNumber(bytes, value);
    return add(name, bytes);
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

void appendTime(std::string& bytes, std::uint64_t time) {
  appendNumber(bytes, static_cast<std::uint32_t>(time / SECOND));
  appendNumber(bytes, static_cast<std::uint32_t>(time % SECOND));
}

std::string timeField(std::uint64_t time) {
  std::string bytes;
  appendTime(bytes, time);
  return bytes;
}

std::string recordOf(const Fields& header, const std::string& data) {
  std::string bytes;
  appendNumber(bytes, static_cast<std::uint32_t>(header.bytes().size()));
  bytes += header.bytes();
  appendNumber(bytes, static_cast<std::uint32_t>(data.size()));
  return bytes + data;
}

class BagWriter : public RecordingWriter {
 public:
  BagWriter(const std::string& path, Packing packing) : path_(path), file_(path), packing_(packing) {
    file_.write(BAG_VERSION_LINE);
    file_.write(header(0));
  }
  std::uint32_t connect(const RecordedConnection& connection) override;
  void write(std::uint32_t connection, std::uint64_t time, const std::uint8_t* data,
             std::size_t size) override;
  using RecordingWriter::write;
  void close() override;
  std::uint64_t size() const override { return file_.position(); }

 private:
  struct Place {
    std::uint64_t time;
    std::uint32_t offset;
  };
  struct ChunkInfo {
    std::uint64_t position = 0, first = std::numeric_limits<std::uint64_t>::max(), last = 0;
    std::map<std::uint32_t, std::uint32_t> counts;  // by connection
  };

  std::string header(std::uint64_t index) const;
  void flush();

  std::string path_;
  OutputFile file_;
  Packing packing_;
  std::vector<std::string> connections_;  // their records
  std::vector<bool> in_file_;             // a connection's record has been written
  std::string chunk_;
  std::map<std::uint32_t, std::vector<Place>> places_;  // of the chunk's messages
  ChunkInfo info_;
  std::vector<ChunkInfo> infos_;
};

std::string BagWriter::header(std::uint64_t index) const {
  Fields fields(BagOp::bag);
  fields.number("index_pos", index)
      .number("conn_count", static_cast<std::uint32_t>(connections_.size()))
      .number("chunk_count", static_cast<std::uint32_t>(infos_.size()));
  return recordOf(fields, std::string(BAG_HEADER_SIZE - fields.bytes().size(), ' '));
}

std::uint32_t BagWriter::connect(const RecordedConnection& connection) {
  if (connection.encoding != "ros1")
    throw Error(path_ + ": topic " + connection.topic + " is encoded as " + connection.encoding +
                ", expected ros1");
  const auto number = static_cast<std::uint32_t>(connections_.size());
  Fields more;
  more.add("topic", connection.topic)
      .add("type", connection.type)
      .add("md5sum", connection.md5sum)
      .add("message_definition", connection.definition);
  for (const auto& [name, value] : connection.more) more.add(name, value);
  connections_.push_back(recordOf(
      Fields(BagOp::connection).number("conn", number).add("topic", connection.topic), more.bytes()));
  in_file_.push_back(false);
  return number;
}

void BagWriter::write(std::uint32_t connection, std::uint64_t time, const std::uint8_t* data,
                      std::size_t size) {
  if (time / SECOND > std::numeric_limits<std::uint32_t>::max())
    throw Error(path_ + ": a time of " + std::to_string(time / SECOND) +
                " s, expected at most 4294967295 s in a bag");
  if (!in_file_.at(connection)) {
    in_file_[connection] = true;
    chunk_ += connections_[connection];
  }
  places_[connection].push_back({time, static_cast<std::uint32_t>(chunk_.size())});
  ++info_.counts[connection];
  info_.first = std::min(info_.first, time);
  info_.last = std::max(info_.last, time);
  chunk_ += recordOf(Fields(BagOp::message).number("conn", connection).add("time", timeField(time)),
                     std::string(reinterpret_cast<const char*>(data), size));
  if (chunk_.size() >= CHUNK_TARGET) flush();
}

void BagWriter::flush() {
  if (chunk_.empty()) return;
  info_.position = file_.position();
  file_.write(recordOf(Fields(BagOp::chunk)
                           .add("compression", packing_ == Packing::lz4 ? "lz4" : "none")
                           .number("size", static_cast<std::uint32_t>(chunk_.size())),
                       pack(packing_, chunk_)));
  for (const auto& [connection, places] : places_) {
    std::string data;
    for (const Place& place : places) {
      appendTime(data, place.time);
      appendNumber(data, place.offset);
    }
    file_.write(recordOf(Fields(BagOp::index)
                             .number("ver", INDEX_VERSION)
                             .number("conn", connection)
                             .number("count", static_cast<std::uint32_t>(places.size())),
                         data));
  }
  infos_.push_back(std::exchange(info_, {}));
  places_.clear();
  chunk_.clear();
  file_.flush();  // what is complete outlives this program
}

void BagWriter::close() {
  flush();
  const std::uint64_t index = file_.position();
  for (const std::string& connection : connections_) file_.write(connection);
  for (const ChunkInfo& info : infos_) {
    std::string data;
    for (const auto& [connection, count] : info.counts) {
      appendNumber(data, connection);
      appendNumber(data, count);
    }
    file_.write(recordOf(Fields(BagOp::chunk_info)
                             .number("ver", INDEX_VERSION)
                             .number("chunk_pos", info.position)
                             .add("start_time", timeField(info.first))
                             .add("end_time", timeField(info.last))
                             .number("count", static_cast<std::uint32_t>(info.counts.size())),
                         data));
  }
  file_.rewrite(std::string(BAG_VERSION_LINE).size(), header(index));
  file_.close();
}

}  // namespace

std::unique_ptr<RecordingWriter> createBag(const std::string& path, Packing packing) {
  return std::make_unique<BagWriter>(path, packing);
}

}  // namespace smartmill
