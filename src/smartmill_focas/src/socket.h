#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

#include "smartmill_focas/codec.h"

namespace smartmill::focas {

/// Owns a file descriptor.
class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(int fd) : fd_(fd) {}
  Descriptor(Descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    if (this != &other) {
      reset();
      fd_ = std::exchange(other.fd_, -1);
    }
    return *this;
  }
  ~Descriptor() { reset(); }
  void reset();
  int get() const { return fd_; }
  bool valid() const { return fd_ >= 0; }

 private:
  int fd_ = -1;
};

/// What one read or write on a non-blocking socket did.
enum class Transfer { done, would_block, closed };

/// No blocking, no Nagle, not inherited by child processes.
void prepareSocket(int fd);

constexpr int KEEP_ALIVE_PROBES = 2;
/// A peer that has gone without a word is an error of an idle socket one second after so many questions of a
/// second each; one lost packet is none.
void keepAlive(int fd, int probes = KEEP_ALIVE_PROBES);

constexpr int DEAF_PROBES = 5;  ///< that keepAlive() needs for isDeaf()
/// Nothing has come back from the other side for 1.8 s: no word that what was sent has arrived, or none to
/// the questions that are put to it after one second of silence, four a second (a lost packet or two are
/// none). A side that takes nothing for want of room still answers. To be asked many times a second.
bool isDeaf(int fd);

/// Reads at most max_bytes into the reader.
Transfer readSome(int fd, FrameReader& reader, std::size_t max_bytes);

/// Writes from the front of pending and removes what went out; done only when all of it went.
Transfer writeSome(int fd, Bytes& pending);

/// strerror, thread-safe.
std::string errorText(int error_number);

}  // namespace smartmill::focas
