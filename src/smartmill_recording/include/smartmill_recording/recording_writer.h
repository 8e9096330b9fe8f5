#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "smartmill_core/names.h"
#include "smartmill_recording/conversions.h"
#include "smartmill_recording/message_codec.h"
#include "smartmill_recording/recording_file.h"

namespace smartmill {

/// Compression of a recording's chunks; zstd in MCAP files only.
enum class RecordingCompression { none, lz4, zstd };

/// Writes a recording. Until close() it is the file PATH.active, which an unfinished writer removes.
class RecordingWriter {
 public:
  RecordingWriter() = default;
  RecordingWriter(const RecordingWriter&) = delete;
  RecordingWriter& operator=(const RecordingWriter&) = delete;
  virtual ~RecordingWriter() = default;

  /// @return its number, for write(). @throws Error beyond 65535 connections of an MCAP file.
  virtual std::uint32_t connect(const RecordedConnection& connection) = 0;
  /// @param time [ns] of its reception since 1970-01-01
  /// @throws Error when it cannot be written; on a time beyond 32 bits of seconds in a bag.
  virtual void write(std::uint32_t connection, std::uint64_t time, const std::uint8_t* data,
                     std::size_t size) = 0;
  /// Writes the index, which readers need, and gives the file its name. @throws Error.
  virtual void close() = 0;
  /// [byte] in the file so far.
  virtual std::uint64_t size() const = 0;

  /// A core type as the message that carries it, or a message of smartmill::plain.
  /// @param topic relative to /smartmill, or absolute
  template <class Data>
  void write(const std::string& topic, std::uint64_t time, const Data& data) {
    if constexpr (!IsMessage<Data>::value) {
      write(topic, time, toPlain(data));
    } else {
      const std::string bytes = writeMessage(data);
      write(numberOf(names::absolute(topic), Data::TYPE, Data::MD5, Data::DEFINITION), time,
            reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
    }
  }

 private:
  std::uint32_t numberOf(const std::string& topic, const char* type, const char* md5, const char* definition);

  std::map<std::string, std::uint32_t> numbers_;  // of written topics
};

/// A bag of format 2.0 where the name ends in .bag, an MCAP file of the profile ros1 where it ends in .mcap.
/// @throws Error on another name, when the file cannot be written, or a bag is to be compressed by zstd.
std::unique_ptr<RecordingWriter> createRecording(const std::string& path, RecordingCompression compression);

/// A copy of recordings.
struct ConvertedRecording {
  std::size_t messages = 0;
  std::vector<std::uint64_t> left_out;  ///< [byte] of each input behind its last complete record
};

/// Copies a recording into the other format, or the same: messages, times, definitions and connections stay.
/// @param from the parts of a recording in their order: latched messages that a part repeats from the one
/// before are copied once. A part that was cut off is copied to its last complete record.
/// @param progress called now and then with the share done, 0..1
/// @throws Error on a damaged input; on messages that are not of ROS 1 for a bag.
ConvertedRecording convertRecording(const std::vector<std::string>& from, const std::string& to,
                                    RecordingCompression compression,
                                    const std::function<void(double)>& progress = {});

}  // namespace smartmill
