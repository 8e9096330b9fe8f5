#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <functional>
#include <stdexcept>
#include <string>
#include <thread>

#include "smartmill_focas/codec.h"

namespace smartmill::focas {

/// Converts "a0a0 0001 ..." to bytes; blanks are skipped, text in quotes is copied, Zn is n zero bytes.
inline Bytes hex(const std::string& text) {
  Bytes bytes;
  for (std::size_t i = 0; i < text.size();) {
    if (text[i] == ' ') {
      ++i;
    } else if (text[i] == '"') {
      for (++i; text[i] != '"'; ++i) {
        bytes.push_back(static_cast<std::uint8_t>(text[i]));
      }
      ++i;
    } else if (text[i] == 'Z') {
      std::size_t used = 0;
      const int count = std::stoi(text.substr(i + 1), &used);
      bytes.insert(bytes.end(), static_cast<std::size_t>(count), 0);
      i += 1 + used;
    } else {
      bytes.push_back(static_cast<std::uint8_t>(std::stoi(text.substr(i, 2), nullptr, 16)));
      i += 2;
    }
  }
  return bytes;
}

inline std::string show(const Bytes& bytes) {
  static const char* const DIGITS = "0123456789abcdef";
  std::string text;
  for (std::uint8_t byte : bytes) {
    text += DIGITS[byte >> 4];
    text += DIGITS[byte & 15];
  }
  return text;
}

/// Waits until a condition is true; with a long time limit for slow computers.
inline bool eventually(const std::function<bool()>& condition, double seconds = 120.0) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) {
      return false;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

inline sockaddr_in loopback(std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

/// Owner of a file descriptor.
class OwnedDescriptor {
 public:
  explicit OwnedDescriptor(int fd) : fd_(fd) {}
  OwnedDescriptor(const OwnedDescriptor&) = delete;
  ~OwnedDescriptor() { close(); }
  void close() {
    if (fd_ >= 0) {
      ::close(fd_);
      fd_ = -1;
    }
  }

 protected:
  int fd_;
};

/// A blocking TCP socket without FOCAS.
class RawSocket : public OwnedDescriptor {
 public:
  using OwnedDescriptor::OwnedDescriptor;
  static int connectTo(std::uint16_t port) {
    const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
    const sockaddr_in address = loopback(port);
    if (::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
      throw std::runtime_error("test cannot connect");
    }
    return fd;
  }
  bool send(const Bytes& bytes) {
    std::size_t sent = 0;
    while (sent < bytes.size()) {
      const ssize_t put = ::send(fd_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
      if (put <= 0) {
        return false;
      }
      sent += static_cast<std::size_t>(put);
    }
    return true;
  }
  /// Sends without blocking. @return [byte] accepted by the kernel
  std::size_t sendSome(const Bytes& bytes) {
    const ssize_t put = ::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    return put > 0 ? static_cast<std::size_t>(put) : 0;
  }
  /// Receives count bytes; fewer if the peer closes or the timeout passes.
  Bytes receive(std::size_t count, int timeout_ms = 120000) {
    Bytes bytes;
    while (bytes.size() < count) {
      pollfd wait{fd_, POLLIN, 0};
      if (::poll(&wait, 1, timeout_ms) <= 0) {
        break;
      }
      std::uint8_t buffer[4096];
      const ssize_t got = ::recv(fd_, buffer, std::min(sizeof buffer, count - bytes.size()), 0);
      if (got <= 0) {
        break;
      }
      bytes.insert(bytes.end(), buffer, buffer + got);
    }
    return bytes;
  }
  /// Receives available bytes, at most 4096, after waiting for up to the timeout.
  Bytes receiveSome(int timeout_ms) {
    pollfd wait{fd_, POLLIN, 0};
    std::uint8_t buffer[4096];
    const ssize_t got = ::poll(&wait, 1, timeout_ms) > 0 ? ::recv(fd_, buffer, sizeof buffer, 0) : 0;
    return Bytes(buffer, buffer + (got > 0 ? got : 0));
  }
  /// Waits for the next byte. @return whether the peer has closed the connection
  bool closedByPeer() { return receive(1).empty(); }
  void shutdownSend() { ::shutdown(fd_, SHUT_WR); }
};

/// Listens on a free port of loopback.
class RawListener : public OwnedDescriptor {
 public:
  RawListener() : OwnedDescriptor(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address = loopback(0);
    socklen_t size = sizeof address;
    if (::bind(fd_, reinterpret_cast<sockaddr*>(&address), size) != 0 || ::listen(fd_, 8) != 0) {
      throw std::runtime_error("test cannot listen");
    }
    ::getsockname(fd_, reinterpret_cast<sockaddr*>(&address), &size);
    port_ = ntohs(address.sin_port);
  }
  std::uint16_t port() const { return port_; }
  int accept() { return ::accept(fd_, nullptr, nullptr); }

 private:
  std::uint16_t port_ = 0;
};

}  // namespace smartmill::focas
