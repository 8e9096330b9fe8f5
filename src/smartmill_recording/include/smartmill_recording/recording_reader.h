#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "smartmill_core/names.h"
#include "smartmill_recording/recorded.h"
#include "smartmill_recording/recording_file.h"

namespace smartmill {

/// Passes the messages of a recording (bag or MCAP) to handlers in the order of their reception, without ROS.
class RecordingReader {
 public:
  /// @throws Error as openRecording()
  explicit RecordingReader(const std::string& path);
  /// @param name for messages
  RecordingReader(RecordingBytes bytes, const std::string& name);

  /// @param Data a core type (SampleBlock, CncState, ...) or a message of smartmill::plain; see Recorded
  /// @param topic relative to /smartmill, or absolute. The handler gets the data and the time of their
  /// reception [s].
  template <class Data>
  void on(const std::string& topic, std::function<void(const Data&, double)> handler) {
    const std::string name = names::absolute(topic);
    // One of each for all messages, so that their vectors' memory is taken once.
    handlers_[name] = [this, name, handler = std::move(handler),
                       recorded = std::make_shared<Recorded<Data>>(),
                       accepted = std::string(Recorded<Data>::md5())](const Instance& instance) mutable {
      if (instance.connection.md5sum != accepted) {
        requireFields(instance.connection, Recorded<Data>::type(), Recorded<Data>::definition());
        accepted = instance.connection.md5sum;
      }
      const Data* data = nullptr;
      try {
        data = &recorded->decode(instance.data, instance.size);
      } catch (const std::exception& error) {
        refuse(instance.connection, error);
      }
      handler(*data, instance.time);
    };
  }

  bool has(const std::string& topic) const;

  /// Once: behind it everything has been read.
  /// @param progress called now and then with the share done, 0..1. @throws Error naming the file when it is
  /// damaged, or a topic holds another type, or a message contradicts itself.
  void run(const std::function<void(double)>& progress = {});

  double duration() const;  ///< [s] first to last message that run() has read

 private:
  struct Instance {
    const RecordedConnection& connection;
    const std::uint8_t* data;
    std::uint32_t size;
    double time;  // [s]
  };
  /// Another version of a message may differ in its constants, not in its fields. @throws Error
  void requireFields(const RecordedConnection& connection, const char* type, const char* definition) const;
  [[noreturn]] void refuse(const RecordedConnection& connection, const char* expected) const;
  [[noreturn]] void refuse(const RecordedConnection& connection, const std::exception& error) const;

  std::string path_;
  std::unique_ptr<RecordingFile> file_;
  std::optional<RecordingFile::Entry> first_;
  RecordingFile::Entry last_;
  std::map<std::string, std::function<void(const Instance&)>> handlers_;
};

}  // namespace smartmill
