#pragma once

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

/// Helpers of tests that start their own roslaunch.
namespace smartmill::testing {

/// A port below the ephemeral range of the system, so that it stays free until it is used.
inline std::string freePort() {
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
    if (free) return std::to_string(port);
  }
  ADD_FAILURE() << "no free port";
  return "0";
}

inline std::string contentOf(const std::string& file) {
  std::ifstream in(file);
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

/// Runs a command with its output in a file. @return its exit code
inline int run(const std::string& command, const std::string& log) {
  return std::system(("timeout --signal=INT 400 " + command + " >'" + log + "' 2>&1").c_str());
}

}  // namespace smartmill::testing
