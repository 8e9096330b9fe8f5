#include "smartmill_cnc/linuxcnc/local_socket.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>
#include <utility>

#include "smartmill_core/error.h"

namespace smartmill::cnc::linuxcnc {
namespace {

constexpr std::size_t MAX_UNSENT = 4 << 20;  // [byte]
constexpr int BACKLOG = 8;

std::string errorText() {
  return std::generic_category().message(errno);
}

sockaddr_un addressOf(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof address.sun_path) {
    throw Error(path + ": path too long for a socket, at most " +
                std::to_string(sizeof address.sun_path - 1) + " characters");
  }
  std::memcpy(address.sun_path, path.c_str(), path.size() + 1);
  return address;
}

LocalDescriptor makeSocket() {
  LocalDescriptor descriptor(::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!descriptor.valid()) {
    throw Error("cannot create a local socket: " + errorText());
  }
  return descriptor;
}

}  // namespace

LocalConnection::LocalConnection(LocalDescriptor descriptor) : descriptor_(std::move(descriptor)) {
}

LocalConnection LocalConnection::to(const std::string& path) {
  const sockaddr_un address = addressOf(path);
  LocalDescriptor descriptor = makeSocket();
  if (::connect(descriptor.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    throw Error("no server at " + path + ": " + errorText());
  }
  return LocalConnection(std::move(descriptor));
}

int LocalConnection::peer() const {
  ucred other{};
  socklen_t size = sizeof other;
  return ::getsockopt(descriptor_.get(), SOL_SOCKET, SO_PEERCRED, &other, &size) == 0 ? other.pid : 0;
}

void LocalConnection::close() {
  descriptor_.reset();
  decoder_ = {};
  outgoing_.clear();
}

void LocalConnection::fail(const std::string& why) {
  close();
  fault_ = why;
}

void LocalConnection::receive() {
  char bytes[65536];
  while (open()) {
    const ssize_t got = ::recv(descriptor_.get(), bytes, sizeof bytes, 0);
    if (got > 0) {
      decoder_.push(bytes, static_cast<std::size_t>(got));
      // Received bytes are decoded before more are read, which bounds the buffer.
      if (static_cast<std::size_t>(got) < sizeof bytes || decoder_.waiting() > LONGEST_PROGRAM) {
        return;
      }
    } else if (got < 0 && errno == EINTR) {
      continue;
    } else if (got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) {
      return;
    } else {
      fail(got == 0 ? "the peer has closed the connection" : errorText());
    }
  }
}

std::optional<Received> LocalConnection::next() {
  try {
    return decoder_.next();
  } catch (const Error& e) {
    fail(e.what());
    return std::nullopt;
  }
}

bool LocalConnection::wait(double seconds) const {
  pollfd entry{descriptor_.get(), POLLIN, 0};
  return open() && ::poll(&entry, 1, static_cast<int>(seconds * 1e3 + 0.999)) > 0;
}

void LocalConnection::send(const Message& message, std::uint16_t sequence) {
  if (!open()) {
    return;
  }
  outgoing_ += encode(message, sequence);
  flush();
  if (outgoing_.size() > MAX_UNSENT) {
    fail("the peer does not read");
  }
}

void LocalConnection::flush() {
  while (open() && !outgoing_.empty()) {
    const ssize_t sent = ::send(descriptor_.get(), outgoing_.data(), outgoing_.size(), MSG_NOSIGNAL);
    if (sent > 0) {
      outgoing_.erase(0, static_cast<std::size_t>(sent));
    } else if (sent < 0 && errno == EINTR) {
      continue;
    } else if (sent < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) {
      return;
    } else {
      fail(errorText());
    }
  }
}

LocalDescriptor listenAt(const std::string& path) {
  const sockaddr_un address = addressOf(path);
  bool in_use = true;
  try {
    LocalConnection::to(path);
  } catch (const Error&) {
    in_use = false;
  }
  if (in_use) {
    throw Error(path + ": another server listens there");
  }
  ::unlink(path.c_str());
  LocalDescriptor descriptor = makeSocket();
  const mode_t before = ::umask(0077);
  const int bound = ::bind(descriptor.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address);
  ::umask(before);
  if (bound != 0 || ::listen(descriptor.get(), BACKLOG) != 0) {
    throw Error(path + ": cannot listen: " + errorText());
  }
  return descriptor;
}

std::optional<LocalConnection> acceptFrom(const LocalDescriptor& listener) {
  LocalDescriptor descriptor(::accept4(listener.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
  if (!descriptor.valid()) {
    return std::nullopt;
  }
  return LocalConnection(std::move(descriptor));
}

}  // namespace smartmill::cnc::linuxcnc
