#pragma once

#include <ros/serialization.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <deque>
#include <functional>
#include <future>
#include <map>
#include <queue>
#include <string>
#include <utility>
#include <vector>

namespace smartmill {

/// Where the bytes of a bag come from.
struct BagBytes {
  std::uint64_t size = 0;
  /// Copies bytes that lie within size; may be called by two threads at once. @throws Error when they cannot
  /// be read.
  std::function<void(std::uint64_t at, char* to, std::size_t count)> read;
};

/// A bag of format 2.0 (wiki.ros.org/Bags/Format/2.0), read from its beginning to its end without believing
/// its index: rosbag's own library takes memory for whatever length a damaged index tells and reads beyond
/// its buffers. Every length is looked at before it is used. A chunk is read and unpacked once, ahead of who
/// reads by a thread of its own; only what the index tells of a chunk's first time is believed, and looked at
/// when the chunk comes.
class BagFile {
 public:
  struct Connection {
    std::string topic, type, md5sum;
  };
  /// Of one message.
  struct Entry {
    std::uint32_t seconds = 0, nanoseconds = 0;  ///< of its reception
    std::uint32_t chunk = 0, offset = 0, size = 0;
    std::uint32_t connection = 0;
    double time() const { return static_cast<double>(seconds) + 1e-9 * static_cast<double>(nanoseconds); }
  };

  /// @param name for messages. @throws Error of one line: no bag, cut off, damaged, not indexed.
  BagFile(BagBytes bytes, std::string name);
  BagFile(const BagFile&) = delete;
  BagFile& operator=(const BagFile&) = delete;

  const std::map<std::uint32_t, Connection>& connections() const { return connections_; }
  /// The next message in the order of their reception. @return false behind the last. @throws Error.
  bool next(Entry* entry);
  const Connection& connection(const Entry& entry) const { return connections_.at(entry.connection); }
  /// The message's bytes, good until the next call. @throws Error.
  const std::uint8_t* data(const Entry& entry);
  /// Of the chunks, what next() has gone through. [1]
  double share() const;

 private:
  using Time = std::pair<std::uint32_t, std::uint32_t>;  // [s], [ns]
  struct Chunk {
    std::uint64_t begin = 0, at = 0;  // of its record, of what is packed
    std::uint32_t stored = 0, size = 0;
    enum class Packing { none, bz2, lz4 } packing = Packing::none;
    Time first;         // none of its messages is older
    Time first_behind;  // nor of the chunks behind it
    bool seen = false;  // unpacked before, its checksum was right
  };
  struct Loaded {
    std::uint32_t chunk = 0;
    std::vector<std::uint8_t> bytes, stored;
  };
  struct Waiting {
    Time time;
    std::size_t arrival = 0;
    Entry entry;
    bool operator>(const Waiting& other) const {
      return time != other.time ? time > other.time : arrival > other.arrival;
    }
  };
  struct Header;
  struct Record;

  [[noreturn]] void fail(const std::string& what) const;
  void look(std::uint64_t at, std::uint8_t* to, std::size_t count) const;
  Record record(std::uint64_t at) const;
  Header headerOf(const std::uint8_t* data, std::size_t size) const;
  void begin(std::uint64_t* at) const;
  void addConnection(const Header& header, const std::uint8_t* data, std::size_t size);
  void addChunk(const Header& header, const Record& record);
  void setFirstTimes(const std::map<std::uint64_t, Time>& told);
  void index(std::uint32_t number);
  void addMessage(const Header& header, const Entry& place);
  Loaded spare();
  void unpack(const Chunk& chunk, Loaded* loaded) const;
  void ahead(std::uint32_t number);
  const std::vector<std::uint8_t>& load(std::uint32_t number);

  BagBytes bytes_;
  std::string name_;
  std::vector<Chunk> chunks_;
  std::map<std::uint32_t, Connection> connections_;
  mutable std::vector<std::uint8_t> window_;  // of the file, while its records are gone through
  mutable std::uint64_t window_at_ = 0;
  std::uint32_t indexed_ = 0;  // chunks
  std::size_t arrivals_ = 0;   // messages
  std::priority_queue<Waiting, std::vector<Waiting>, std::greater<>> waiting_;
  std::deque<Loaded> loaded_;   // the newest in front
  std::future<Loaded> coming_;  // is waited for before anything else here goes
};

/// The bytes of a file. @throws Error when it cannot be opened.
BagBytes bagBytesOf(const std::string& path);

/// ros::serialization::IStream, but no vector is made longer than the bytes that are left can fill.
class CheckedStream : public ros::serialization::Stream {
 public:
  // NOLINTNEXTLINE(readability-identifier-naming): ros::serialization asks for it by this name
  static const ros::serialization::StreamType stream_type = ros::serialization::stream_types::Input;

  CheckedStream(const std::uint8_t* data, std::uint32_t size)
      : Stream(const_cast<std::uint8_t*>(data), size) {}  // which only reads

  template <class Value>
  void next(Value& value) {
    ros::serialization::deserialize(*this, value);
  }
  template <class Value, class Allocator>
  void next(std::vector<Value, Allocator>& values) {
    std::uint32_t count = 0;
    constexpr std::uint32_t LEAST = ros::message_traits::IsSimple<Value>::value ? sizeof(Value) : 1;
    if (getLength() >= sizeof count) {
      std::memcpy(&count, getData(), sizeof count);
      if (count > (getLength() - sizeof count) / LEAST) {
        ros::serialization::throwStreamOverrun();
      }
    }
    ros::serialization::deserialize(*this, values);
  }
};

}  // namespace smartmill
