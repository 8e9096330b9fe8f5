#include "listener.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <stdexcept>

namespace smartmill::focas {
namespace {

// [byte] of an Ethernet packet. Loopback packets have 64 kB, and the kernel of a client buffers twenty of
// them (tcp_sndbuf_expand of Linux), so that the client would run megabytes ahead of the machine.
constexpr int SEGMENT = 1460;

}  // namespace

Listener::Listener(const ServerOptions& options) : options_(options), port_(options.port) {
  open();
}

void Listener::open() {
  try {
    socket_ = listenOn(options_.bind_address, port_, [this](int fd) {
      // Set before listen(), so that accepted connections advertise the small window from the first packet
      // on.
      ::setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &options_.receive_buffer, sizeof options_.receive_buffer);
      ::setsockopt(fd, IPPROTO_TCP, TCP_MAXSEG, &SEGMENT, sizeof SEGMENT);
    });
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(std::string("FOCAS server: ") + error.what());
  }
}

void Listener::listen(bool on) {
  if (!on) {
    close();
  } else if (!socket_.valid()) {
    try {
      open();
    } catch (const std::runtime_error&) {
      close();
    }
  }
}

Descriptor Listener::accept() const {
  Descriptor socket(::accept(socket_.get(), nullptr, nullptr));
  if (socket.valid()) {
    prepareSocket(socket.get());
    keepAlive(socket.get());
  }
  return socket;
}

}  // namespace smartmill::focas
