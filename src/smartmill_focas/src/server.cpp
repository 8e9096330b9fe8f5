#include "smartmill_focas/server.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <list>
#include <stdexcept>
#include <thread>

#include "calls/calls.h"
#include "listener.h"
#include "session.h"
#include "socket.h"

namespace smartmill::focas {
namespace {

constexpr int IDLE_POLL_MS = 200;

}  // namespace

class Server::Impl {
 public:
  Impl(const ServerOptions& options, const ControllerInterface& controller)
      : options_(options),
        info_(controller.state.sysInfo()),
        calls_(callsOf(controller, info_)),
        listener_(options),
        shared_{options_, controller, info_, calls_, sessions_} {
    int ends[2];
    if (::pipe(ends) != 0) {
      throw std::runtime_error("FOCAS server: no pipe: " + errorText(errno));
    }
    wake_read_ = Descriptor(ends[0]);
    wake_write_ = Descriptor(ends[1]);
    for (int end : ends) {
      ::fcntl(end, F_SETFD, FD_CLOEXEC);
    }
    thread_ = std::thread([this] { run(); });
  }

  ~Impl() { stop(); }

  void stop() {
    if (!thread_.joinable()) {
      return;
    }
    stopping_ = true;
    const char byte = 0;
    if (::write(wake_write_.get(), &byte, 1) < 0) {
      // The thread then ends after the poll period.
    }
    thread_.join();
  }

  std::uint16_t port() const { return listener_.port(); }
  int connections() const { return open_count_; }

 private:
  void run() {
    while (!stopping_) {
      // At the maximum number of connections TCP refuses further ones.
      listener_.listen(!isFull());
      serve();
    }
    for (Session& session : sessions_) {
      session.drop();
    }
    sessions_.clear();
    listener_.close();
    open_count_ = 0;
  }

  bool isFull() const { return sessions_.size() >= static_cast<std::size_t>(options_.max_connections); }

  /// Waits for events and serves them.
  void serve() {
    // poll() ignores a descriptor of -1.
    std::vector<pollfd> waits{{wake_read_.get(), POLLIN, 0}, {listener_.descriptor(), POLLIN, 0}};
    int period = IDLE_POLL_MS;
    for (const Session& session : sessions_) {
      waits.push_back({session.descriptor(), session.events(), 0});
      period = session.pollPeriod(period);
    }
    ::poll(waits.data(), waits.size(), period);
    std::size_t i = 2;
    for (Session& session : sessions_) {
      session.serve(waits[i++].revents);
    }
    sessions_.remove_if([](const Session& session) { return session.dead(); });
    if ((waits[1].revents & POLLIN) != 0) {
      accept();
    }
    open_count_ = static_cast<int>(std::count_if(
        sessions_.begin(), sessions_.end(), [](const Session& session) { return session.circuit() != 0; }));
  }

  void accept() {
    while (!isFull()) {
      Descriptor socket = listener_.accept();
      if (!socket.valid()) {
        return;
      }
      sessions_.emplace_back(std::move(socket), shared_);
    }
  }

  ServerOptions options_;
  const SysInfo info_;
  const CallTable calls_;
  Listener listener_;
  Session::Shared shared_;
  Descriptor wake_read_, wake_write_;
  std::list<Session> sessions_;  // used by the thread only
  std::atomic<bool> stopping_{false};
  std::atomic<int> open_count_{0};
  std::thread thread_;
};

Server::Server(const ServerOptions& options, const ControllerInterface& controller)
    : impl_(std::make_unique<Impl>(options, controller)) {
}
Server::~Server() = default;
std::uint16_t Server::port() const {
  return impl_->port();
}
void Server::stop() {
  impl_->stop();
}
int Server::connections() const {
  return impl_->connections();
}

}  // namespace smartmill::focas
