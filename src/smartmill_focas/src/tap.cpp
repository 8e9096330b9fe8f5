#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <list>
#include <thread>

#include "connection.h"
#include "smartmill_focas/recording.h"

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
      : host_(std::move(host)), host_port_(host_port), timeout_(timeout), listener_(std::move(listener)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socket_ = Descriptor(::socket(AF_INET, SOCK_STREAM, 0));
    const int on = 1;
    ::setsockopt(socket_.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    prepareSocket(socket_.get());
    socklen_t size = sizeof address;
    if (::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address), size) != 0 ||
        ::listen(socket_.get(), 16) != 0) {
      throw std::runtime_error("cannot listen on 127.0.0.1:" + std::to_string(port) + ": " +
                               errorText(errno));
    }
    ::getsockname(socket_.get(), reinterpret_cast<sockaddr*>(&address), &size);
    port_ = ntohs(address.sin_port);
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
    Descriptor controller = connect();
    if (!controller.valid()) {
      return;  // closes the connection of the client, as without the tap
    }
    pairs_.emplace_back();
    pairs_.back().number = ++connections_made_;
    pairs_.back().client = std::move(client);
    pairs_.back().controller = std::move(controller);
  }

  Descriptor connect() const {
    addrinfo hints{};
    hints.ai_family = AF_INET;
    hints.ai_socktype = SOCK_STREAM;
    addrinfo* found = nullptr;
    if (::getaddrinfo(host_.c_str(), std::to_string(host_port_).c_str(), &hints, &found) != 0) {
      return {};
    }
    Descriptor socket(::socket(AF_INET, SOCK_STREAM, 0));
    prepareSocket(socket.get());
    int error = ::connect(socket.get(), found->ai_addr, found->ai_addrlen) == 0 ? 0 : errno;
    ::freeaddrinfo(found);
    if (error == EINPROGRESS) {
      pollfd wait{socket.get(), POLLOUT, 0};
      socklen_t size = sizeof error;
      error = ETIMEDOUT;
      if (::poll(&wait, 1, millisecondsUntil(deadlineIn(timeout_))) > 0) {
        ::getsockopt(socket.get(), SOL_SOCKET, SO_ERROR, &error, &size);
      }
    }
    return error == 0 ? std::move(socket) : Descriptor();
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
