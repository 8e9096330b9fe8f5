#include "smartmill_recording/recording_writer.h"

#include <filesystem>
#include <set>
#include <tuple>
#include <utility>

#include "bag_writer.h"
#include "mcap_writer.h"
#include "smartmill_core/error.h"

namespace smartmill {
namespace {

constexpr std::size_t REPORT_EVERY = 1000;  // messages

/// What distinguishes a connection: topic, type, definition, encoding and the other fields of its header.
using Publisher = std::tuple<std::string, std::string, std::string, std::string, std::string,
                             std::map<std::string, std::string>>;
Publisher publisherOf(const RecordedConnection& c) {
  return {c.topic, c.type, c.md5sum, c.definition, c.encoding, c.more};
}

}  // namespace

std::uint32_t RecordingWriter::numberOf(const std::string& topic, const char* type, const char* md5,
                                        const char* definition) {
  const auto known = numbers_.find(topic);
  if (known != numbers_.end()) return known->second;
  RecordedConnection connection;
  connection.topic = topic;
  connection.type = type;
  connection.md5sum = md5;
  connection.definition = definition;
  return numbers_[topic] = connect(connection);
}

std::unique_ptr<RecordingWriter> createRecording(const std::string& path, RecordingCompression compression) {
  const std::string ending = std::filesystem::path(path).extension().string();
  const bool bag = ending == ".bag";
  if (!bag && ending != ".mcap") throw Error(path + ": expected a name that ends in .bag or .mcap");
  if (bag && compression == RecordingCompression::zstd)
    throw Error(path + ": a bag is compressed by lz4 or not at all, zstd is for MCAP files");
  const Packing packing = compression == RecordingCompression::zstd  ? Packing::zstd
                          : compression == RecordingCompression::lz4 ? Packing::lz4
                                                                     : Packing::none;
  return bag ? createBag(path, packing) : createMcap(path, packing);
}

ConvertedRecording convertRecording(const std::vector<std::string>& from, const std::string& to,
                                    RecordingCompression compression,
                                    const std::function<void(double)>& progress) {
  std::error_code ignored;
  for (const std::string& part : from) {
    if (std::filesystem::equivalent(part, to, ignored)) throw Error(to + ": is the input itself");
  }
  const std::unique_ptr<RecordingWriter> writer = createRecording(to, compression);
  ConvertedRecording result;
  std::map<Publisher, std::uint32_t> numbers;                  // there
  std::map<std::uint32_t, std::vector<std::uint8_t>> latched;  // last message by number
  for (const std::string& part : from) {
    const std::unique_ptr<RecordingFile> file = openRecording(part, RecordingEnd::any);
    const auto numberOf = [&](const RecordedConnection& connection) {
      const auto [known, is_new] = numbers.try_emplace(publisherOf(connection), 0);
      if (is_new) known->second = writer->connect(connection);
      return known->second;
    };
    std::map<std::uint32_t, std::uint32_t> there;  // numbers by the number here
    for (const auto& [number, connection] : file->connections()) there[number] = numberOf(connection);
    std::set<std::uint32_t> begun;  // connections with a message in this part
    RecordingFile::Entry entry;
    while (file->next(&entry)) {
      const RecordedConnection& connection = file->connection(entry);
      // A bag may declare a connection in its chunk alone.
      const auto [number, is_new] = there.try_emplace(entry.connection, 0);
      if (is_new) number->second = numberOf(connection);
      const std::uint8_t* const data = file->data(entry);
      if (connection.isLatched()) {
        std::vector<std::uint8_t> bytes(data, data + entry.size);
        const bool first = begun.insert(entry.connection).second;
        const auto before = latched.find(number->second);
        if (first && before != latched.end() && before->second == bytes) continue;
        latched[number->second] = std::move(bytes);
      }
      writer->write(number->second, entry.time, data, entry.size);
      if (++result.messages % REPORT_EVERY == 0 && progress)
        progress((static_cast<double>(result.left_out.size()) + file->share()) /
                 static_cast<double>(from.size()));
    }
    result.left_out.push_back(file->leftOut());
  }
  writer->close();
  if (progress) progress(1.0);
  return result;
}

}  // namespace smartmill
