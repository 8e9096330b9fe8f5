#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <future>
#include <map>
#include <optional>
#include <queue>
#include <string>
#include <vector>

#include "packing.h"
#include "smartmill_recording/recording_file.h"

namespace smartmill {

/// What bags and MCAP files share: messages in chunks, which a thread reads and decompresses ahead of the
/// reader, in the order of reception. A chunk stays in memory until its last message was returned; only where
/// chunks that overlap in time exceed a limit is one of them decompressed again. Of the file's index only the
/// time of each chunk's first message is used, and compared when the chunk is read.
class ChunkedFile : public RecordingFile {
 public:
  const std::map<std::uint32_t, RecordedConnection>& connections() const override { return connections_; }
  bool next(Entry* entry) override;
  const std::uint8_t* data(const Entry& entry) override;
  double share() const override;
  std::uint64_t leftOut() const override { return left_out_; }

 protected:
  struct Chunk {
    std::uint64_t begin = 0;   // of its record
    std::uint64_t at = 0;      // of its packed bytes
    std::uint64_t stored = 0;  // [byte]
    std::uint32_t size = 0;    // [byte] when unpacked
    Packing packing = Packing::none;
    std::uint64_t first = 0;          // [ns] none of its messages is older
    std::uint64_t first_behind = 0;   // [ns] nor of the chunks behind it
    std::uint32_t checksum = 0;       // CRC-32 of the unpacked bytes; 0: not stated
    bool seen = false;                // unpacked before, its checksum was right
    std::vector<std::uint8_t> bytes;  // unpacked, while loaded
    bool loaded = false;
    std::size_t waiting = 0;  // messages that next() has found and not returned yet
  };

  ChunkedFile(RecordingBytes bytes, std::string name, RecordingEnd end)
      : bytes_(std::move(bytes)), name_(std::move(name)), end_(end) {}

  /// One line that names the file. @throws Error
  [[noreturn]] void fail(const std::string& what) const;
  /// Copies bytes that lie within the file; few of them by a window, since records are next to each other.
  void copy(std::uint64_t at, std::uint8_t* to, std::size_t count) const;
  /// Bytes that lie within the file, as a string.
  std::string textAt(std::uint64_t at, std::size_t count) const;
  /// After the last chunk was added.
  void finishChunks();
  /// Calls index() for all chunks before the first next(), when the file does not state what is in them.
  void survey();
  /// Calls addMessage() for each message of an unpacked chunk. @throws Error
  virtual void index(std::uint32_t number, const std::vector<std::uint8_t>& bytes) = 0;
  /// After the last chunk was read. @throws Error
  virtual void checkEnd(std::size_t messages) const { (void)messages; }
  /// @param entry whose connection may not be known yet
  void addMessage(const Entry& entry);
  const std::vector<std::uint8_t>& load(std::uint32_t number);

  RecordingBytes bytes_;
  std::string name_;
  RecordingEnd end_;
  std::uint64_t left_out_ = 0;  // [byte]
  bool surveying_ = false;      // connections are gathered, messages not yet
  std::vector<Chunk> chunks_;
  std::map<std::uint32_t, RecordedConnection> connections_;

 private:
  struct Loaded {
    std::vector<std::uint8_t> bytes, stored;
  };
  struct Waiting {
    std::size_t arrival = 0;
    Entry entry;
    bool operator>(const Waiting& other) const {
      return entry.time != other.entry.time ? entry.time > other.entry.time : arrival > other.arrival;
    }
  };

  Loaded spare();
  void release(Chunk& chunk);
  void keep(std::uint32_t number, Loaded&& loaded);
  void unpackInto(const Chunk& chunk, Loaded* loaded) const;
  void ahead(std::uint32_t number);

  mutable std::vector<std::uint8_t> window_;  // of the file, while its records are scanned
  mutable std::uint64_t window_at_ = 0;
  std::uint32_t indexed_ = 0;  // chunks
  std::size_t arrivals_ = 0;   // messages
  std::priority_queue<Waiting, std::vector<Waiting>, std::greater<>> waiting_;
  std::deque<std::uint32_t> loaded_;    // chunks in the order of loading; some are released already
  std::size_t kept_ = 0;                // [byte] of loaded chunks
  std::optional<std::uint32_t> spent_;  // chunk whose last message was returned last
  std::vector<std::vector<std::uint8_t>> spares_;        // memory of released chunks
  std::vector<std::vector<std::uint8_t>> stored_;        // memory of packed bytes
  std::map<std::uint32_t, std::future<Loaded>> coming_;  // by chunk; destroyed first, which waits for them
};

}  // namespace smartmill
