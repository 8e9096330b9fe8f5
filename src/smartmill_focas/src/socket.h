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

/// A peer that has gone without a word is an error of an idle socket after three seconds; one lost packet is
/// none.
void keepAlive(int fd);

/// Nothing comes back from the other side any more: no word that what was sent has arrived for 1.9 s, or none
/// to the questions of keepAlive() for 2.2 s (one lost packet is none). A side that takes nothing for want of
/// room still answers.
bool isDeaf(int fd);

/// Reads at most max_bytes into the reader.
Transfer readSome(int fd, FrameReader& reader, std::size_t max_bytes);

/// Writes from the front of pending and removes what went out; done only when all of it went.
Transfer writeSome(int fd, Bytes& pending);

/// strerror, thread-safe.
std::string errorText(int error_number);

}  // namespace smartmill::focas
