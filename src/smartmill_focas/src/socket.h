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

/// Result of a read or write on a non-blocking socket.
enum class Transfer { done, would_block, closed };

/// Non-blocking, without Nagle's algorithm, not inherited by child processes.
void prepareSocket(int fd);

constexpr int KEEP_ALIVE_PROBES = 2;
/// TCP keep-alive: an idle socket fails if the peer does not answer this many probes at intervals of 1 s,
/// after 1 s of silence.
void keepAlive(int fd, int probes = KEEP_ALIVE_PROBES);

constexpr int UNRESPONSIVE_PROBES = 5;  ///< for keepAlive(), required by isUnresponsive()
/// Whether the peer has sent nothing for 1.8 s: neither an acknowledgement of data nor an answer to the
/// probes, which are sent four times a second after 1 s of silence (so that one or two lost packets do not
/// count). A peer with a full receive buffer still answers. To be called many times a second, since it
/// triggers the probes.
bool isUnresponsive(int fd);

/// Reads at most max_bytes into the reader.
Transfer readSome(int fd, FrameReader& reader, std::size_t max_bytes);

/// Writes from the front of pending and removes the written bytes; done only if all are written.
Transfer writeSome(int fd, Bytes& pending);

/// strerror, thread-safe.
std::string errorText(int error_number);

}  // namespace smartmill::focas
