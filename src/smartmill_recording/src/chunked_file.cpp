#include "chunked_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <limits>
#include <stdexcept>
#include <utility>

#include "checksum.h"
#include "smartmill_core/error.h"

namespace smartmill {
namespace {

constexpr std::size_t WINDOW = 4096;            // [byte]
constexpr std::size_t MOST_KEPT = 256U << 20U;  // [byte] of chunks that overlap in time
constexpr std::size_t LEAST_KEPT = 4;           // chunks
constexpr std::uint32_t READ_AHEAD = 3;         // chunks
constexpr std::uint64_t SECOND = 1000000000;    // [ns]

}  // namespace

double RecordingFile::Entry::seconds() const {
  const std::uint64_t whole = time / SECOND, rest = time % SECOND;
  return static_cast<double>(whole) + 1e-9 * static_cast<double>(rest);
}

void ChunkedFile::fail(const std::string& what) const {
  throw Error(name_ + ": " + what);
}

void ChunkedFile::copy(std::uint64_t at, std::uint8_t* to, std::size_t count) const {
  if (count > WINDOW) {
    bytes_.read(at, reinterpret_cast<char*>(to), count);
    return;
  }
  if (at < window_at_ || at + count > window_at_ + window_.size()) {
    window_.resize(static_cast<std::size_t>(std::min<std::uint64_t>(WINDOW, bytes_.size - at)));
    bytes_.read(at, reinterpret_cast<char*>(window_.data()), window_.size());
    window_at_ = at;
  }
  std::copy_n(window_.begin() + static_cast<std::ptrdiff_t>(at - window_at_), count, to);
}

std::string ChunkedFile::textAt(std::uint64_t at, std::size_t count) const {
  std::string bytes(count, '\0');
  copy(at, reinterpret_cast<std::uint8_t*>(bytes.data()), count);
  return bytes;
}

void ChunkedFile::finishChunks() {
  std::uint64_t least = std::numeric_limits<std::uint64_t>::max();
  for (auto chunk = chunks_.rbegin(); chunk != chunks_.rend(); ++chunk) {
    chunk->first_behind = least;
    least = std::min(least, chunk->first);
  }
  window_.clear();
}

void ChunkedFile::survey() {
  surveying_ = true;
  for (std::uint32_t i = 0; i < chunks_.size(); ++i) index(i, load(i));
  surveying_ = false;
}

bool ChunkedFile::next(Entry* entry) {
  if (spent_) release(chunks_[*spent_]);
  spent_.reset();
  const auto waits = [this] {
    return waiting_.empty() || waiting_.top().entry.time > chunks_[indexed_ - 1].first_behind;
  };
  while (indexed_ < chunks_.size() && waits()) {
    index(indexed_, load(indexed_));
    if (chunks_[indexed_].waiting == 0) release(chunks_[indexed_]);
    if (++indexed_ == chunks_.size()) checkEnd(arrivals_);
  }
  if (waiting_.empty()) return false;
  *entry = waiting_.top().entry;
  waiting_.pop();
  if (--chunks_[entry->chunk].waiting == 0) spent_ = entry->chunk;
  if (connections_.count(entry->connection) == 0)
    fail("is damaged: a message of connection " + std::to_string(entry->connection) +
         ", which is not declared");
  return true;
}

double ChunkedFile::share() const {
  return chunks_.empty() ? 1.0 : static_cast<double>(indexed_) / static_cast<double>(chunks_.size());
}

void ChunkedFile::addMessage(const Entry& entry) {
  if (entry.time < chunks_[entry.chunk].first)
    fail("is damaged: a message is older than the first time that is stated of its chunk");
  waiting_.push({arrivals_++, entry});
  ++chunks_[entry.chunk].waiting;
}

/// Memory for a chunk: that of a released one, or of the oldest where too much is kept.
ChunkedFile::Loaded ChunkedFile::spare() {
  if (spares_.empty() && kept_ > MOST_KEPT && loaded_.size() > LEAST_KEPT) release(chunks_[loaded_.front()]);
  Loaded loaded;
  for (auto [pool, taken] : {std::pair{&spares_, &loaded.bytes}, std::pair{&stored_, &loaded.stored}}) {
    if (pool->empty()) continue;
    *taken = std::move(pool->back());
    pool->pop_back();
  }
  return loaded;
}

void ChunkedFile::release(Chunk& chunk) {
  if (!chunk.loaded) return;
  chunk.loaded = false;
  kept_ -= chunk.bytes.size();
  spares_.push_back(std::move(chunk.bytes));
  while (!loaded_.empty() && !chunks_[loaded_.front()].loaded) loaded_.pop_front();
}

void ChunkedFile::keep(std::uint32_t number, Loaded&& loaded) {
  Chunk& chunk = chunks_[number];
  chunk.bytes = std::move(loaded.bytes);
  stored_.push_back(std::move(loaded.stored));
  chunk.loaded = true;
  kept_ += chunk.bytes.size();
  loaded_.push_back(number);
}

/// @throws std::exception
void ChunkedFile::unpackInto(const Chunk& chunk, Loaded* loaded) const {
  const bool packed = chunk.packing != Packing::none;
  std::vector<std::uint8_t>& stored = packed ? loaded->stored : loaded->bytes;
  stored.resize(static_cast<std::size_t>(chunk.stored));
  bytes_.read(chunk.at, reinterpret_cast<char*>(stored.data()), stored.size());
  if (packed) unpack(chunk.packing, stored, chunk.size, chunk.seen, loaded->bytes);
  if (chunk.checksum != 0 && !chunk.seen &&
      crc32(loaded->bytes.data(), loaded->bytes.size()) != chunk.checksum)
    throw std::runtime_error("checksum mismatch");
}

/// Begins to unpack the chunks behind one that was loaded. What is only copied takes less time than a thread.
void ChunkedFile::ahead(std::uint32_t number) {
  const auto end =
      std::min(static_cast<std::uint64_t>(chunks_.size()), std::uint64_t{number} + 1 + READ_AHEAD);
  for (std::uint32_t next = number + 1; next < end; ++next) {
    const Chunk& chunk = chunks_[next];
    if ((chunk.packing == Packing::none && chunk.checksum == 0) || coming_.count(next) != 0) continue;
    coming_[next] = std::async(std::launch::async, [this, next, loaded = spare()]() mutable {
      unpackInto(chunks_[next], &loaded);
      return std::move(loaded);
    });
  }
}

const std::vector<std::uint8_t>& ChunkedFile::load(std::uint32_t number) {
  Chunk& chunk = chunks_[number];
  if (chunk.loaded) return chunk.bytes;
  try {
    const auto begun = coming_.find(number);
    if (begun != coming_.end()) {
      std::future<Loaded> unpacked = std::move(begun->second);
      coming_.erase(begun);
      keep(number, unpacked.get());
    } else {
      Loaded loaded = spare();
      unpackInto(chunk, &loaded);
      keep(number, std::move(loaded));
    }
  } catch (const Error&) {
    throw;
  } catch (const std::exception& e) {
    fail("is damaged: the chunk at byte " + std::to_string(chunk.begin) + " cannot be unpacked: " + e.what());
  }
  if (!chunk.seen) {
    chunk.seen = true;
    ahead(number);
  }
  return chunk.bytes;
}

const std::uint8_t* ChunkedFile::data(const Entry& entry) {
  return load(entry.chunk).data() + entry.offset;
}

RecordingBytes bytesOfFile(const std::string& path) {
  const auto unread = [path] {
    return Error(path + ": cannot be read: not found, no permission, or cut off while it is read");
  };
  const int opened = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  const std::shared_ptr<const int> file(new int(opened), [](const int* number) {
    if (*number >= 0) ::close(*number);
    delete number;
  });
  const off_t size = opened < 0 ? -1 : ::lseek(opened, 0, SEEK_END);
  if (size < 0) throw unread();
  RecordingBytes bytes;
  bytes.size = static_cast<std::uint64_t>(size);
  bytes.read = [file, unread](std::uint64_t at, char* to, std::size_t count) {
    while (count > 0) {
      const ssize_t got = ::pread(*file, to, count, static_cast<off_t>(at));
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) throw unread();
      at += static_cast<std::uint64_t>(got);
      to += got;
      count -= static_cast<std::size_t>(got);
    }
  };
  return bytes;
}

}  // namespace smartmill
