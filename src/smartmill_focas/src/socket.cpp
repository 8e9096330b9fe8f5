#include "socket.h"

#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <system_error>

namespace smartmill::focas {

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
