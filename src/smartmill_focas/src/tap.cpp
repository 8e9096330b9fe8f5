#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <list>
#include <stdexcept>
#include <thread>

#include "smartmill_focas/recording.h"
#include "socket.h"

namespace smartmill::focas {
namespace {

constexpr int POLL_MS = 20;
constexpr std::size_t READ_STEP = 8192;    // [byte]
constexpr std::size_t MAX_QUEUED = 65536;  // [byte] queued in one direction

/// One direction of one connection.
struct Channel {
  Bytes queued;  // to be forwarded
  FrameReader frames;
  bool decodable = true;
};

/// Connection of a client and the corresponding connection to the controller.
struct Pair {
  int number = 0;
  Descriptor client, controller;
  Channel up, down;
  bool dead = false;
};

}  // namespace

class Tap::Impl {
 public:
  Impl(std::uint16_t port, std::string host, std::uint16_t host_port, double timeout, Listener listener)
      : host_(std::move(host)),
        host_port_(host_port),
        port_(port),
        timeout_(timeout),
        listener_(std::move(listener)) {
    socket_ = listenOn("127.0.0.1", port_);
    start_ = Clock::now();
    thread_ = std::thread([this] { run(); });
  }
  ~Impl() {
    stopping_ = true;
    thread_.join();
  }
  std::uint16_t port() const { return port_; }

 private:
  void run() {
    std::vector<pollfd> waits;
    while (!stopping_) {
      waits.assign(1, {socket_.get(), POLLIN, 0});
      for (const Pair& pair : pairs_) {
        waits.push_back({pair.client.get(), eventsOf(pair.up, pair.down), 0});
        waits.push_back({pair.controller.get(), eventsOf(pair.down, pair.up), 0});
      }
      ::poll(waits.data(), waits.size(), POLL_MS);
      for (Pair& pair : pairs_) {
        forward(pair, pair.client, pair.controller, pair.up, true);
        forward(pair, pair.controller, pair.client, pair.down, false);
      }
      pairs_.remove_if([](const Pair& pair) { return pair.dead; });
      accept();
    }
  }

  static short eventsOf(const Channel& from, const Channel& to) {
    const short read = from.queued.size() < MAX_QUEUED ? POLLIN : 0;
    return static_cast<short>(read | (to.queued.empty() ? 0 : POLLOUT));
  }

  void accept() {
    Descriptor client(::accept(socket_.get(), nullptr, nullptr));
    if (!client.valid()) {
      return;
    }
    prepareSocket(client.get());
    try {
      Descriptor controller = connectTo(host_, host_port_, deadlineIn(timeout_));
      pairs_.emplace_back();
      pairs_.back().number = ++connections_made_;
      pairs_.back().client = std::move(client);
      pairs_.back().controller = std::move(controller);
    } catch (const std::runtime_error&) {
      // The connection of the client is closed, as without the tap.
    }
  }

  void forward(Pair& pair, const Descriptor& from, const Descriptor& to, Channel& channel, bool from_client) {
    if (pair.dead) {
      return;
    }
    Bytes chunk(READ_STEP);
    Transfer read = Transfer::would_block;
    if (channel.queued.size() < MAX_QUEUED) {
      const ssize_t got = ::recv(from.get(), chunk.data(), chunk.size(), 0);
      const bool later = got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR);
      read = got > 0 ? Transfer::done : later ? Transfer::would_block : Transfer::closed;
      chunk.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
    }
    if (read == Transfer::done) {
      report(pair, channel, chunk, from_client);
      channel.queued.insert(channel.queued.end(), chunk.begin(), chunk.end());
    }
    const Transfer wrote = channel.queued.empty() ? Transfer::done : writeSome(to.get(), channel.queued);
    pair.dead = read == Transfer::closed || wrote == Transfer::closed;
  }

  void report(const Pair& pair, Channel& channel, const Bytes& chunk, bool from_client) {
    if (!channel.decodable) {
      return;
    }
    try {
      channel.frames.append(chunk.data(), chunk.size());
      while (std::optional<Frame> frame = channel.frames.next()) {
        const double time = std::chrono::duration<double>(Clock::now() - start_).count();
        listener_({time, pair.number, from_client, std::move(*frame)});
      }
    } catch (const WireError&) {
      channel.decodable = false;
    }
  }

  std::string host_;
  std::uint16_t host_port_, port_ = 0;
  double timeout_;
  Listener listener_;
  Descriptor socket_;
  Clock::time_point start_;
  std::list<Pair> pairs_;
  int connections_made_ = 0;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

Tap::Tap(std::uint16_t port, const std::string& host, std::uint16_t host_port, double timeout,
         Listener listener)
    : impl_(std::make_unique<Impl>(port, host, host_port, timeout, std::move(listener))) {
}
Tap::~Tap() = default;
std::uint16_t Tap::port() const {
  return impl_->port();
}

}  // namespace smartmill::focas
