#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

#include "smartmill_focas/codec.h"
#include "smartmill_focas/descriptor.h"

// By hand: Boost.Asio does not report the disconnect of a client that is not read (POLLRDHUP), its
// synchronous calls have no deadline, TCP_KEEPIDLE and TCP_INFO need the descriptor, and the tap has as many
// lines with it.

namespace smartmill::focas {

using Clock = std::chrono::steady_clock;

/// [ms] for poll().
int millisecondsUntil(Clock::time_point deadline);
Clock::time_point deadlineIn(double seconds);

/// Result of a read or write on a non-blocking socket.
enum class Transfer { done, would_block, closed };

/// Non-blocking, without Nagle's algorithm, not inherited by child processes.
void prepareSocket(int fd);

/// Sets options of a socket before it connects or listens.
using Configure = std::function<void(int fd)>;
/// @return a socket that listens. @param port 0: any free one; receives that of the socket.
/// @throws std::runtime_error "cannot listen on ADDRESS:PORT: REASON".
Descriptor listenOn(const std::string& address, std::uint16_t& port, const Configure& configure = {});
/// @return a connected socket. @throws std::runtime_error with the reason.
Descriptor connectTo(const std::string& host, std::uint16_t port, Clock::time_point deadline,
                     const Configure& configure = {});

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
