#pragma once

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>

#include <gtest/gtest.h>

namespace smartmill {

/// A port of loopback below the ephemeral range of the system, so that it stays free until it is used.
inline int freePort() {
  static int next = getpid() % 12000;
  for (int i = 0; i < 12000; ++i) {
    const int port = 20000 + next++ % 12000;
    const int s = socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    const bool free = bind(s, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
    close(s);
    if (free) return port;
  }
  ADD_FAILURE() << "no free port";
  return 0;
}

}  // namespace smartmill
