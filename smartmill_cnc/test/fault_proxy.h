#pragma once

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <linux/filter.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <list>
#include <mutex>
#include <thread>
#include <utility>

#include "smartmill_focas/codec.h"

namespace smartmill::cnc {

/// Proxy between bridge and server that modifies their frames as a test requires.
class FaultProxy {
 public:
  /// Bytes sent instead of a frame.
  struct Verdict {
    focas::Bytes to_server, to_client;
    bool hang_up = false;
  };
  using Judge = std::function<Verdict(const focas::Frame&)>;

  static focas::Bytes bytesOf(const focas::Frame& f) {
    return focas::encodeFrame(f.type, f.direction, f.body, f.version);
  }
  static Verdict forward(const focas::Frame& frame) { return {bytesOf(frame), {}, false}; }
  static Verdict forwardReply(const focas::Frame& frame) { return {{}, bytesOf(frame), false}; }

  /// @param up for frames of the bridge @param down for frames of the server
  explicit FaultProxy(std::uint16_t target, Judge up = forward, Judge down = forwardReply)
      : target_(target), up_(std::move(up)), down_(std::move(down)) {
    listener_ = ::socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address = loopback(0);
    socklen_t size = sizeof address;
    EXPECT_EQ(::bind(listener_, reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(::listen(listener_, 8), 0);
    ::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size);
    port = ntohs(address.sin_port);
    thread_ = std::thread([this] { run(); });
  }
  ~FaultProxy() {
    done_ = true;
    thread_.join();
    ::close(listener_);
  }

  std::uint16_t port = 0;
  std::atomic<bool> stalled{false};  ///< reads all frames and forwards none: half-open
  std::atomic<bool> byte_by_byte{false};
  /// The kernel discards all further packets of the bridge's oldest connection, its DNC circuit, as if the
  /// other computer had been switched off.
  std::atomic<bool> deaf{false};

 private:
  struct Pair {
    int client, server;
    focas::FrameReader up, down;
  };
  static sockaddr_in loopback(std::uint16_t port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(port);
    return address;
  }
  static bool read(int from, focas::FrameReader& reader) {
    pollfd wait{from, POLLIN, 0};
    if (::poll(&wait, 1, 0) <= 0) {
      return true;
    }
    std::uint8_t buffer[4096];
    const ssize_t got = ::recv(from, buffer, sizeof buffer, 0);
    if (got > 0) {
      reader.append(buffer, static_cast<std::size_t>(got));
    }
    return got > 0;
  }
  void put(int to, const focas::Bytes& bytes) const {
    const std::size_t piece = byte_by_byte ? 1 : std::max<std::size_t>(bytes.size(), 1);
    for (std::size_t at = 0; at < bytes.size(); at += piece) {
      ::send(to, bytes.data() + at, std::min(piece, bytes.size() - at), MSG_NOSIGNAL);
    }
  }
  bool judge(const Pair& pair, focas::FrameReader& reader, const Judge& judge) const {
    while (const std::optional<focas::Frame> frame = reader.next()) {
      const Verdict verdict = stalled ? Verdict{} : judge(*frame);
      put(pair.server, verdict.to_server);
      put(pair.client, verdict.to_client);
      if (verdict.hang_up) {
        return false;
      }
    }
    return true;
  }
  bool serve(Pair& pair) const {
    const bool server = read(pair.server, pair.down), client = read(pair.client, pair.up);
    return judge(pair, pair.down, down_) && judge(pair, pair.up, up_) && server && client;
  }
  void run() {
    std::list<Pair> pairs;
    while (!done_) {
      pollfd wait{listener_, POLLIN, 0};
      if (::poll(&wait, 1, 0) > 0) {
        const sockaddr_in address = loopback(target_);
        Pair pair{::accept(listener_, nullptr, nullptr), ::socket(AF_INET, SOCK_STREAM, 0), {}, {}};
        if (::connect(pair.server, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) {
          pairs.push_back(std::move(pair));
        } else {
          ::close(pair.client);
          ::close(pair.server);
        }
      }
      if (deaf.exchange(false) && !pairs.empty()) {
        sock_filter none = BPF_STMT(BPF_RET | BPF_K, 0);
        const sock_fprog program{1, &none};
        EXPECT_EQ(::setsockopt(pairs.front().client, SOL_SOCKET, SO_ATTACH_FILTER, &program, sizeof program),
                  0);
      }
      pairs.remove_if([&](Pair& pair) {
        if (serve(pair)) {
          return false;
        }
        ::close(pair.client);
        ::close(pair.server);
        return true;
      });
      std::this_thread::sleep_for(std::chrono::microseconds(50));
    }
    for (const Pair& pair : pairs) {
      ::close(pair.client);
      ::close(pair.server);
    }
  }

  std::uint16_t target_;
  Judge up_, down_;
  int listener_ = -1;
  std::atomic<bool> done_{false};
  std::thread thread_;
};

}  // namespace smartmill::cnc
