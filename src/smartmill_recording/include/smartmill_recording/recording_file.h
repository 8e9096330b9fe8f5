#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>

namespace smartmill {

/// Where the bytes of a recording come from.
struct RecordingBytes {
  std::uint64_t size = 0;
  /// Copies bytes that lie within size; may be called by two threads at once. @throws Error when they cannot
  /// be read.
  std::function<void(std::uint64_t at, char* to, std::size_t count)> read;
};

/// The bytes of a file. @throws Error when it cannot be opened.
RecordingBytes bytesOfFile(const std::string& path);

/// A recorded topic of one publisher.
struct RecordedConnection {
  std::string topic, type, md5sum, definition;
  std::string encoding = "ros1";            ///< of its messages
  std::map<std::string, std::string> more;  ///< other fields of its header: callerid, latching

  /// Whether a new subscriber gets the last message of the publisher.
  bool isLatched() const {
    const auto latching = more.find("latching");
    return latching != more.end() && latching->second == "1";
  }
};

/// The messages of a recording in the order of their reception. Every length in the file is compared with the
/// bytes that are there before it is used: a damaged file is refused with one line, without a read beyond a
/// buffer or an allocation that the file's bytes do not fill.
class RecordingFile {
 public:
  /// Of one message.
  struct Entry {
    std::uint64_t time = 0;  ///< [ns] of its reception since 1970-01-01
    std::uint32_t chunk = 0, offset = 0, size = 0;
    std::uint32_t connection = 0;
    double seconds() const;  ///< [s] as ros::Time::toSec()
  };

  RecordingFile() = default;
  RecordingFile(const RecordingFile&) = delete;
  RecordingFile& operator=(const RecordingFile&) = delete;
  virtual ~RecordingFile() = default;

  /// By number.
  virtual const std::map<std::uint32_t, RecordedConnection>& connections() const = 0;
  /// The next message in the order of reception; messages of one instant in the order of the file.
  /// @return false behind the last. @throws Error.
  virtual bool next(Entry* entry) = 0;
  /// The message's bytes, valid until the next call of next() or data(). @throws Error.
  virtual const std::uint8_t* data(const Entry& entry) = 0;
  /// [1] share of the file that next() has read.
  virtual double share() const = 0;
  /// [byte] behind the last complete record of a recording that was cut off, which are not read.
  virtual std::uint64_t leftOut() const = 0;
  /// @throws std::out_of_range
  const RecordedConnection& connection(const Entry& entry) const {
    return connections().at(entry.connection);
  }
};

/// What a recording must end with: its index, or anything, as when its recorder was killed.
enum class RecordingEnd { index, any };

/// Opens a bag of format 2.0 (wiki.ros.org/Bags/Format/2.0) or an MCAP file (mcap.dev/spec) with messages of
/// ROS 1, by its first bytes and not by its name.
/// @throws Error of one line: missing, neither format, cut off, damaged, without index.
std::unique_ptr<RecordingFile> openRecording(const std::string& path, RecordingEnd end = RecordingEnd::index);
/// @param name for messages
std::unique_ptr<RecordingFile> openRecording(RecordingBytes bytes, const std::string& name,
                                             RecordingEnd end = RecordingEnd::index);

/// Whether a tool should take this as a recording: its first bytes or, where it cannot be read, its name say
/// so.
bool isRecording(const std::string& path);

}  // namespace smartmill
