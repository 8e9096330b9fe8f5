#include "socket.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <stdexcept>
#include <system_error>

namespace smartmill::focas {

int millisecondsUntil(Clock::time_point deadline) {
  const auto remaining =
      std::chrono::duration_cast<std::chrono::milliseconds>(deadline - Clock::now()).count();
  return static_cast<int>(std::clamp<long long>(remaining + 1, 0, 3600000));
}

Clock::time_point deadlineIn(double seconds) {
  return Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

void Descriptor::reset() {
  if (fd_ >= 0) {
    ::close(fd_);
    fd_ = -1;
  }
}

void prepareSocket(int fd) {
  ::fcntl(fd, F_SETFL, ::fcntl(fd, F_GETFL, 0) | O_NONBLOCK);
  ::fcntl(fd, F_SETFD, FD_CLOEXEC);
  const int on = 1;
  ::setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
}

Descriptor listenOn(const std::string& address, std::uint16_t& port, const Configure& configure) {
  constexpr int BACKLOG = 64;
  const auto fail = [&](const std::string& reason) {
    throw std::runtime_error("cannot listen on " + address + ":" + std::to_string(port) + ": " + reason);
  };
  sockaddr_in where{};
  where.sin_family = AF_INET;
  where.sin_port = htons(port);
  if (::inet_pton(AF_INET, address.c_str(), &where.sin_addr) != 1) {
    fail("not an IPv4 address");
  }
  Descriptor socket(::socket(AF_INET, SOCK_STREAM, 0));
  if (!socket.valid()) {
    fail(errorText(errno));
  }
  const int on = 1;
  ::setsockopt(socket.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  if (configure) {
    configure(socket.get());
  }
  prepareSocket(socket.get());
  if (::bind(socket.get(), reinterpret_cast<const sockaddr*>(&where), sizeof where) != 0 ||
      ::listen(socket.get(), BACKLOG) != 0) {
    fail(errorText(errno));
  }
  socklen_t size = sizeof where;
  ::getsockname(socket.get(), reinterpret_cast<sockaddr*>(&where), &size);
  port = ntohs(where.sin_port);
  return socket;
}

Descriptor connectTo(const std::string& host, std::uint16_t port, Clock::time_point deadline,
                     const Configure& configure) {
  addrinfo hints{};
  hints.ai_family = AF_INET;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  const int resolved = ::getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found);
  if (resolved != 0) {
    throw std::runtime_error(::gai_strerror(resolved));
  }
  Descriptor socket(::socket(AF_INET, SOCK_STREAM, 0));
  int error = socket.valid() ? 0 : errno;
  if (error == 0) {
    prepareSocket(socket.get());
    if (configure) {
      configure(socket.get());
    }
    error = ::connect(socket.get(), found->ai_addr, found->ai_addrlen) == 0 ? 0 : errno;
  }
  ::freeaddrinfo(found);
  if (error == EINPROGRESS) {
    pollfd wait{socket.get(), POLLOUT, 0};
    int ready = 0;
    do {
      ready = ::poll(&wait, 1, millisecondsUntil(deadline));
    } while (ready < 0 && errno == EINTR);
    if (ready == 0) {
      throw std::runtime_error("no answer in time");
    }
    socklen_t size = sizeof error;
    ::getsockopt(socket.get(), SOL_SOCKET, SO_ERROR, &error, &size);
  }
  if (error != 0) {
    throw std::runtime_error(errorText(error));
  }
  return socket;
}

namespace {
constexpr int IDLE = 1;  // [s] of silence of the peer before the first probe
}

void keepAlive(int fd, int probes) {
  const int on = 1, idle = IDLE, interval = 1;  // [s]
  ::setsockopt(fd, SOL_SOCKET, SO_KEEPALIVE, &on, sizeof on);
  ::setsockopt(fd, IPPROTO_TCP, TCP_KEEPIDLE, &idle, sizeof idle);
  ::setsockopt(fd, IPPROTO_TCP, TCP_KEEPINTVL, &interval, sizeof interval);
  ::setsockopt(fd, IPPROTO_TCP, TCP_KEEPCNT, &probes, sizeof probes);
}

bool isUnresponsive(int fd) {
  constexpr std::uint32_t UNRESPONSIVE_MS = 1800, PROBE_PERIOD_MS = 250;
  tcp_info info{};
  socklen_t size = sizeof info;
  int waiting = 0;
  if (::getsockopt(fd, IPPROTO_TCP, TCP_INFO, &info, &size) != 0 || ::ioctl(fd, TIOCOUTQ, &waiting) != 0) {
    return false;
  }
  const std::uint32_t silent = info.tcpi_last_ack_recv;  // [ms]
  if (info.tcpi_unacked == 0) {
    if (waiting > 0) {
      return false;  // the peer's window is full: TCP probes it at increasing intervals
    }
    const std::uint32_t probes_from = 1000 * IDLE;
    if (silent > probes_from && info.tcpi_probes <= (silent - probes_from) / PROBE_PERIOD_MS) {
      // Setting it again makes Linux send a probe at once (tcp_sock_set_keepidle) instead of once a second.
      const int idle = IDLE;
      ::setsockopt(fd, IPPROTO_TCP, TCP_KEEPIDLE, &idle, sizeof idle);
    }
  }
  return silent > UNRESPONSIVE_MS;
}

Transfer readSome(int fd, FrameReader& reader, std::size_t max_bytes) {
  std::array<std::uint8_t, 16384> chunk;  // NOLINT(cppcoreguidelines-pro-type-member-init): recv fills it
  std::size_t total = 0;
  while (total < max_bytes) {
    const ssize_t got = ::recv(fd, chunk.data(), std::min(chunk.size(), max_bytes - total), 0);
    if (got > 0) {
      reader.append(chunk.data(), static_cast<std::size_t>(got));
      total += static_cast<std::size_t>(got);
    } else if (got == 0) {
      return Transfer::closed;
    } else if (errno == EAGAIN || errno == EWOULDBLOCK) {
      return Transfer::would_block;
    } else if (errno != EINTR) {
      return Transfer::closed;
    }
  }
  return Transfer::done;
}

Transfer writeSome(int fd, Bytes& pending) {
  std::size_t sent = 0;
  Transfer result = Transfer::done;
  while (sent < pending.size()) {
    const ssize_t put = ::send(fd, pending.data() + sent, pending.size() - sent, MSG_NOSIGNAL);
    if (put >= 0) {
      sent += static_cast<std::size_t>(put);
    } else if (errno == EAGAIN || errno == EWOULDBLOCK) {
      result = Transfer::would_block;
      break;
    } else if (errno != EINTR) {
      result = Transfer::closed;
      break;
    }
  }
  pending.erase(pending.begin(), pending.begin() + static_cast<std::ptrdiff_t>(sent));
  return result;
}

std::string errorText(int error_number) {
  return std::generic_category().message(error_number);
}

}  // namespace smartmill::focas
