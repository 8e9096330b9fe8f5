#include "smartmill_focas/server.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <deque>
#include <list>
#include <stdexcept>
#include <thread>

#include "data_calls.h"
#include "program_transfer.h"
#include "socket.h"

namespace smartmill::focas {
namespace {

constexpr std::size_t READ_STEP =
    8192;  // [byte] maximum to read from a connection before its frames are served
constexpr std::size_t MAX_UNSENT =
    1 << 18;  // [byte] of replies that a client has not read, above which it is not served
constexpr int IDLE_POLL_MS = 200;
constexpr int SESSION_POLL_MS = 5;  // period of dncAbort()
constexpr int BLOCKED_POLL_MS = 2;  // period of offering text to a full buffer of the machine
constexpr int LISTEN_BACKLOG = 64;
// [byte] of an Ethernet packet. Loopback packets have 64 kB, and the kernel of a client buffers twenty of
// them (tcp_sndbuf_expand of Linux), so that the client would run megabytes ahead of the machine.
constexpr int SEGMENT = 1460;

enum class Dnc { none, open, aborted };

struct Connection {
  Descriptor socket;
  FrameReader reader;
  std::deque<Frame> frames;    // read, not yet served
  std::size_t text_taken = 0;  // [byte] of the DNC text of the first frame that the machine has accepted
  Bytes unsent;
  int circuit = 0;  // 0: not opened
  Dnc dnc = Dnc::none;
  ProgramTransfer transfer;
  int abort_code = EW_OK;
  bool blocked = false;  // the machine's buffer is full
  bool peer_closed = false;
  bool close_when_sent = false;
  bool dead = false;
};

}  // namespace

class Server::Impl {
 public:
  Impl(const ServerOptions& options, ControllerInterface& controller)
      : options_(options), controller_(controller), calls_(controller) {
    listen(options_.port);
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

  std::uint16_t port() const { return port_; }
  int connections() const { return open_count_; }

 private:
  void listen(std::uint16_t port) {
    const std::string where = options_.bind_address + ":" + std::to_string(port);
    const auto fail = [&](const std::string& reason) {
      throw std::runtime_error("FOCAS server: cannot listen on " + where + ": " + reason);
    };
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    if (::inet_pton(AF_INET, options_.bind_address.c_str(), &address.sin_addr) != 1) {
      fail("not an IPv4 address");
    }
    listener_ = Descriptor(::socket(AF_INET, SOCK_STREAM, 0));
    if (!listener_.valid()) {
      fail(errorText(errno));
    }
    const int on = 1;
    ::setsockopt(listener_.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    // Set before listen(), so that accepted connections advertise the small window from the first packet on.
    ::setsockopt(listener_.get(), SOL_SOCKET, SO_RCVBUF, &options_.receive_buffer,
                 sizeof options_.receive_buffer);
    ::setsockopt(listener_.get(), IPPROTO_TCP, TCP_MAXSEG, &SEGMENT, sizeof SEGMENT);
    prepareSocket(listener_.get());
    if (::bind(listener_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
        ::listen(listener_.get(), LISTEN_BACKLOG) != 0) {
      fail(errorText(errno));
    }
    socklen_t size = sizeof address;
    ::getsockname(listener_.get(), reinterpret_cast<sockaddr*>(&address), &size);
    port_ = ntohs(address.sin_port);
  }

  void run() {
    std::vector<pollfd> waits;
    while (!stopping_) {
      waits.clear();
      waits.push_back({wake_read_.get(), POLLIN, 0});
      watchListener();
      waits.push_back({listener_.get(), POLLIN, 0});  // -1 is ignored
      int timeout = IDLE_POLL_MS;
      for (const Connection& c : connections_) {
        short events = 0;
        if (!c.peer_closed) {
          // While the buffer of the machine is full, the client is not read, so that TCP stops it; a
          // disconnect is still detected.
          events =
              static_cast<short>(c.blocked || c.unsent.size() > MAX_UNSENT ? POLLRDHUP : POLLIN | POLLRDHUP);
        }
        if (!c.unsent.empty()) {
          events = static_cast<short>(events | POLLOUT);
        }
        // poll() would return at once for a closed peer.
        waits.push_back({c.peer_closed ? -1 : c.socket.get(), events, 0});
        if (c.transfer.uploading()) {
          timeout = std::min(timeout, SESSION_POLL_MS);
        }
        if (c.blocked) {
          timeout = std::min(timeout, BLOCKED_POLL_MS);
        } else if (c.dnc == Dnc::open) {
          timeout = std::min(timeout, SESSION_POLL_MS);
        }
      }
      ::poll(waits.data(), waits.size(), timeout);
      std::size_t i = 2;
      for (Connection& c : connections_) {
        serve(c, waits[i++].revents);
      }
      connections_.remove_if([](const Connection& c) { return c.dead; });
      if ((waits[1].revents & POLLIN) != 0) {
        accept();
      }
      open_count_ = static_cast<int>(std::count_if(connections_.begin(), connections_.end(),
                                                   [](const Connection& c) { return c.circuit != 0; }));
    }
    for (Connection& c : connections_) {
      drop(c);
    }
    connections_.clear();
    listener_.reset();
    open_count_ = 0;
  }

  /// Stops listening at the maximum number of connections, so that TCP refuses further ones.
  void watchListener() {
    const bool full = connections_.size() >= static_cast<std::size_t>(options_.max_connections);
    if (full) {
      listener_.reset();
    } else if (!listener_.valid()) {
      try {
        listen(port_);
      } catch (const std::runtime_error&) {
        listener_.reset();  // the port is in use; retried in the next cycle
      }
    }
  }

  void accept() {
    while (connections_.size() < static_cast<std::size_t>(options_.max_connections)) {
      Descriptor socket(::accept(listener_.get(), nullptr, nullptr));
      if (!socket.valid()) {
        return;
      }
      prepareSocket(socket.get());
      keepAlive(socket.get());
      connections_.emplace_back();
      connections_.back().socket = std::move(socket);
    }
  }

  void drop(Connection& c) {
    if (c.dnc == Dnc::open) {
      c.dnc = Dnc::none;
      controller_.dncDisconnected();
    }
    c.dead = true;
  }

  void serve(Connection& c, short events) {
    try {
      if ((events & (POLLERR | POLLNVAL)) != 0) {
        drop(c);
        return;
      }
      if (c.dnc == Dnc::open) {
        const int code = controller_.dncAbort();
        if (code != EW_OK) {
          c.dnc = Dnc::aborted;
          c.abort_code = code;
          sendError(c, FRAME_DNC_DATA, code);
        }
      }
      if ((events & (POLLIN | POLLRDHUP | POLLHUP)) != 0 && !c.peer_closed) {
        // Of a disconnected client at most one receive buffer remains; it is read at once, so that the end is
        // detected even while the buffer of the machine is full.
        const bool leaving = (events & (POLLRDHUP | POLLHUP)) != 0;
        if (readSome(c.socket.get(), c.reader, leaving ? SIZE_MAX : READ_STEP) == Transfer::closed) {
          c.peer_closed = true;
        }
        while (std::optional<Frame> frame = c.reader.next()) {
          c.frames.push_back(std::move(*frame));
        }
      }
      if (c.peer_closed && c.dnc == Dnc::open && !endIsQueued(c)) {
        drop(c);
        return;
      }
      serveFrames(c);
      if (c.unsent.empty()) {
        c.transfer.push(sender(c));
      }
      if (!c.unsent.empty() && writeSome(c.socket.get(), c.unsent) == Transfer::closed) {
        drop(c);
        return;
      }
      const bool all_sent = c.unsent.empty();
      if ((c.peer_closed && c.frames.empty() && !c.blocked) || (c.close_when_sent && all_sent)) {
        drop(c);
      }
    } catch (const std::exception&) {
      // No FOCAS data: the connection is unusable.
      drop(c);
    }
  }

  static bool endIsQueued(const Connection& c) {
    return std::any_of(c.frames.begin(), c.frames.end(), [](const Frame& frame) {
      return frame.type == FRAME_DNC_END || frame.type == FRAME_DNC_CANCEL;
    });
  }

  void serveFrames(Connection& c) {
    c.blocked = false;
    while (!c.frames.empty() && !c.close_when_sent && c.unsent.size() <= MAX_UNSENT) {
      if (!serveFrame(c, c.frames.front())) {
        c.blocked = true;
        return;
      }
      c.frames.pop_front();
      c.text_taken = 0;
    }
  }

  /// @return false: the frame must wait for the buffer of the machine
  bool serveFrame(Connection& c, const Frame& frame) {
    const std::uint8_t type = frame.type;
    if (frame.is(FRAME_OPEN, DIR_REQUEST)) {
      open(c, frame);
    } else if (frame.is(FRAME_CLOSE, DIR_REQUEST)) {
      if (c.dnc == Dnc::open) {
        controller_.dncDisconnected();
      }
      c.dnc = Dnc::none;
      c.circuit = 0;
      send(c, FRAME_CLOSE, DIR_REPLY, {});
    } else if (c.circuit == 0) {
      if (frame.direction == DIR_REQUEST) {
        sendError(c, type, EW_HANDLE);
      }
    } else if (frame.is(FRAME_DATA, DIR_REQUEST)) {
      data(c, frame);
    } else if (c.circuit == STREAM_CIRCUIT && transferred(c, frame)) {
      return true;
    } else if (frame.is(FRAME_DNC_START, DIR_REQUEST)) {
      dncStart(c);
    } else if (frame.is(FRAME_DNC_DATA, DIR_STREAM)) {
      if (c.dnc == Dnc::open) {
        const char* text = reinterpret_cast<const char*>(frame.body.data()) + c.text_taken;
        const std::size_t size = frame.body.size() - c.text_taken;
        c.text_taken += std::min(size, controller_.dncData(text, size));
        return c.text_taken == frame.body.size();
      }
    } else if (frame.is(FRAME_DNC_END, DIR_REQUEST)) {
      dncEnd(c);
    } else if (frame.is(FRAME_DNC_CANCEL, DIR_STREAM)) {
      if (c.dnc == Dnc::open) {
        int result = DNC_CANCEL;
        if (frame.body.size() >= 4) {
          Reader reader(frame.body);
          result = reader.skip(2).i16();
        }
        controller_.dncCancel(result);
      }
      c.dnc = Dnc::none;
    } else if (frame.direction == DIR_REQUEST) {
      sendError(c, type, EW_FUNC);
    }
    return true;
  }

  void open(Connection& c, const Frame& frame) {
    const int circuit = frame.body.size() >= 2 ? Reader(frame.body).u16() : 0;
    const auto same = std::count_if(connections_.begin(), connections_.end(), [&](const Connection& other) {
      return &other != &c && other.circuit == circuit;
    });
    if ((circuit != STREAM_CIRCUIT && circuit != DATA_CIRCUIT) || same >= options_.max_sessions) {
      // A 31i refuses the sixth session with code 2.
      sendError(c, FRAME_OPEN, 2);
      c.close_when_sent = true;
      return;
    }
    c.circuit = circuit;
    OpenReply reply;
    const SysInfo info = calls_.sysInfo();
    reply.axes = static_cast<int>(info.axes.size());
    reply.spindles = static_cast<int>(info.spindles.size());
    send(c, FRAME_OPEN, DIR_REPLY, encodeOpenReply(reply));
  }

  void data(Connection& c, const Frame& frame) {
    Bytes body;
    try {
      std::vector<SubReply> replies;
      for (const SubRequest& request : decodeRequests(frame.body)) {
        replies.push_back(calls_.answer(request));
      }
      body = encodeReplies(replies);
    } catch (const WireError&) {
      sendError(c, FRAME_DATA, EW_LENGTH);
      return;
    }
    send(c, FRAME_DATA, DIR_REPLY, body);
  }

  bool transferred(Connection& c, const Frame& frame) {
    return c.transfer.handle(frame, controller_, sender(c));
  }

  static ProgramTransfer::Send sender(Connection& c) {
    return
        [&c](std::uint8_t type, Direction direction, const Bytes& body) { send(c, type, direction, body); };
  }

  void dncStart(Connection& c) {
    if (c.circuit != STREAM_CIRCUIT) {
      sendError(c, FRAME_DNC_START, EW_FUNC);
      return;
    }
    const bool taken = std::any_of(connections_.begin(), connections_.end(),
                                   [](const Connection& other) { return other.dnc == Dnc::open; });
    const int code = taken ? EW_BUSY : controller_.dncStart();
    if (code != EW_OK) {
      sendError(c, FRAME_DNC_START, code);
      return;
    }
    c.dnc = Dnc::open;
    send(c, FRAME_DNC_START, DIR_REPLY, {});
  }

  void dncEnd(Connection& c) {
    int code = EW_FUNC;
    if (c.dnc == Dnc::open) {
      code = controller_.dncEnd();
    } else if (c.dnc == Dnc::aborted) {
      code = c.abort_code;
    }
    c.dnc = Dnc::none;
    if (code == EW_OK) {
      send(c, FRAME_DNC_END, DIR_REPLY, {});
    } else {
      sendError(c, FRAME_DNC_END, code);
    }
  }

  static void send(Connection& c, std::uint8_t type, std::uint8_t direction, const Bytes& body) {
    const Bytes frame = encodeFrame(type, direction, body, REPLY_VERSION);
    c.unsent.insert(c.unsent.end(), frame.begin(), frame.end());
  }

  static void sendError(Connection& c, std::uint8_t type, int code) {
    ErrorBody error;
    error.code = static_cast<std::int16_t>(code);
    send(c, type, DIR_ERROR, encodeErrorBody(error));
  }

  ServerOptions options_;
  ControllerInterface& controller_;
  DataCalls calls_;
  Descriptor listener_, wake_read_, wake_write_;
  std::uint16_t port_ = 0;
  std::list<Connection> connections_;  // used by the thread only
  std::atomic<bool> stopping_{false};
  std::atomic<int> open_count_{0};
  std::thread thread_;
};

Server::Server(const ServerOptions& options, ControllerInterface& controller)
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
