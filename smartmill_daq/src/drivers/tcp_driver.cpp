// Frames of samples from a TCP connection (docs/daq.md).
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <system_error>

#include "smartmill_daq/drivers/driver.h"
#include "smartmill_daq/drivers/frame.h"

namespace smartmill::daq {
namespace {

constexpr double CONNECT_TIMEOUT = 1.0;  // [s]

/// As toSec() of a message's stamp, to the last digit.
double secondsOf(std::int64_t nanoseconds) {
  constexpr std::int64_t SECOND = 1000000000;
  const auto whole = nanoseconds / SECOND;
  return static_cast<double>(whole) + 1e-9 * static_cast<double>(nanoseconds % SECOND);
}

int milliseconds(double seconds) {
  return static_cast<int>(seconds * 1e3);
}

class TcpDriver : public Driver {
 public:
  explicit TcpDriver(const DriverSetup& setup) : inputs_(inputNumbers(setup.channels, MOST_CHANNELS)) {
    if (!setup.options) throw Error("options: missing, expected host and port of the device");
    host_ = setup.options->word("host");
    port_ = setup.options->integer("port", 1, 65535);
    const std::string samples =
        setup.options->has("samples") ? setup.options->oneOf("samples", {"volts", "shares"}) : "volts";
    shares_ = samples == "shares";
  }
  ~TcpDriver() override { closeSocket(); }

  void open() override {
    closeSocket();
    decoder_ = {};
    addrinfo hints{};
    hints.ai_family = AF_UNSPEC;
    hints.ai_socktype = SOCK_STREAM;
    addrinfo* found = nullptr;
    if (const int resolved = ::getaddrinfo(host_.c_str(), std::to_string(port_).c_str(), &hints, &found))
      throw DeviceLost(name() + ": " + ::gai_strerror(resolved));
    int error = EADDRNOTAVAIL;
    for (const addrinfo* address = found; address && error != 0; address = address->ai_next)
      error = connectTo(*address);
    ::freeaddrinfo(found);
    if (error != 0) throw DeviceLost(name() + ": " + std::generic_category().message(error));
  }

  bool read(RawBatch* batch, double timeout) override {
    std::optional<Frame> frame = nextFrame();
    if (!frame) {
      pollfd wait{socket_, POLLIN, 0};
      if (::poll(&wait, 1, milliseconds(timeout)) <= 0) return false;
      const ssize_t got = ::recv(socket_, buffer_.data(), buffer_.size(), 0);
      if (got == 0) throw DeviceLost(name() + ": the device has closed the connection");
      if (got < 0) {
        if (errno == EINTR || errno == EAGAIN) return false;
        throw DeviceLost(name() + ": " + std::generic_category().message(errno));
      }
      decoder_.push(buffer_.data(), static_cast<std::size_t>(got));
      frame = nextFrame();
      if (!frame) return false;
    }
    convert(*frame, batch);
    return true;
  }

  void close() override { closeSocket(); }
  bool shareOfRange() const override { return shares_; }

 private:
  std::string name() const { return host_ + ":" + std::to_string(port_); }

  int connectTo(const addrinfo& address) {
    socket_ = ::socket(address.ai_family, address.ai_socktype | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (socket_ < 0) return errno;
    int error = ::connect(socket_, address.ai_addr, address.ai_addrlen) == 0 ? 0 : errno;
    if (error == EINPROGRESS) {
      pollfd wait{socket_, POLLOUT, 0};
      if (::poll(&wait, 1, milliseconds(CONNECT_TIMEOUT)) != 1) {
        error = ETIMEDOUT;
      } else {
        socklen_t size = sizeof error;
        ::getsockopt(socket_, SOL_SOCKET, SO_ERROR, &error, &size);
      }
    }
    // A cable that is pulled out ends the connection after some seconds of silence.
    const int on = 1, seconds = 2;
    ::setsockopt(socket_, SOL_SOCKET, SO_KEEPALIVE, &on, sizeof on);
    ::setsockopt(socket_, IPPROTO_TCP, TCP_KEEPIDLE, &seconds, sizeof seconds);
    ::setsockopt(socket_, IPPROTO_TCP, TCP_KEEPINTVL, &on, sizeof on);
    ::setsockopt(socket_, IPPROTO_TCP, TCP_KEEPCNT, &seconds, sizeof seconds);
    if (error != 0) closeSocket();
    return error;
  }

  void closeSocket() {
    if (socket_ >= 0) ::close(socket_);
    socket_ = -1;
  }

  std::optional<Frame> nextFrame() {
    try {
      return decoder_.next();
    } catch (const Error& error) {
      throw MalformedData(name() + ": " + error.what());
    }
  }

  void convert(const Frame& frame, RawBatch* batch) const {
    const std::size_t most = *std::max_element(inputs_.begin(), inputs_.end());
    if (most >= frame.channels)
      throw Error(name() + ": the device sends " + std::to_string(frame.channels) + " channels, input " +
                  std::to_string(most + 1) + " expected");
    if (isShare(frame.format) != shares_)
      throw Error(name() + ": options.samples: the device sends " + (shares_ ? "volts" : "shares") +
                  ", expected " + (shares_ ? "shares" : "volts"));
    batch->first_index = frame.first_index;
    if (frame.time != 0) batch->time = secondsOf(frame.time);
    if (frame.sample_rate > 0.0) batch->sample_rate = frame.sample_rate;
    batch->values.resize(frame.size() * inputs_.size());
    double* value = batch->values.data();
    for (std::size_t i = 0; i < frame.size(); ++i) {
      for (const std::size_t input : inputs_) *value++ = frame.values[i * frame.channels + input];
    }
    for (std::size_t c = 0; c < inputs_.size(); ++c) {
      batch->overloaded |= (frame.overloaded >> inputs_[c] & 1U) << c;
      batch->bias_fault |= (frame.bias_fault >> inputs_[c] & 1U) << c;
    }
  }

  std::vector<std::size_t> inputs_;
  std::string host_;
  int port_ = 0, socket_ = -1;
  bool shares_ = false;
  FrameDecoder decoder_;
  std::array<char, 1U << 16U> buffer_{};
};

}  // namespace

DriverKind tcpDriver() {
  return {"tcp",
          [](const DriverSetup& setup) { return std::make_unique<TcpDriver>(setup); },
          {{"host", "name or address of the device"},
           {"port", "TCP port of the device"},
           {"samples", "volts (default) or shares of the range"}}};
}

}  // namespace smartmill::daq
