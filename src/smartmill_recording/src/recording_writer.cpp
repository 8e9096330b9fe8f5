#include "smartmill_recording/recording_writer.h"

#include <filesystem>

#include "bag_writer.h"
#include "mcap_writer.h"
#include "smartmill_core/error.h"

namespace smartmill {
namespace {

constexpr std::size_t REPORT_EVERY = 1000;  // messages

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

std::size_t convertRecording(const std::string& from, const std::string& to, RecordingCompression compression,
                             const std::function<void(double)>& progress) {
  std::error_code ignored;
  if (std::filesystem::equivalent(from, to, ignored)) throw Error(to + ": is the input itself");
  const std::unique_ptr<RecordingFile> file = openRecording(from);
  const std::unique_ptr<RecordingWriter> writer = createRecording(to, compression);
  std::map<std::uint32_t, std::uint32_t> numbers;  // there, by the number here
  for (const auto& [number, connection] : file->connections()) numbers[number] = writer->connect(connection);
  RecordingFile::Entry entry;
  std::size_t messages = 0;
  while (file->next(&entry)) {
    auto number = numbers.find(entry.connection);
    // A bag may declare a connection in its chunk alone.
    if (number == numbers.end())
      number = numbers.emplace(entry.connection, writer->connect(file->connection(entry))).first;
    writer->write(number->second, entry.time, file->data(entry), entry.size);
    if (++messages % REPORT_EVERY == 0 && progress) progress(file->share());
  }
  writer->close();
  if (progress) progress(1.0);
  return messages;
}

}  // namespace smartmill
