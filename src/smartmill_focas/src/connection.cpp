#include "connection.h"

#include <poll.h>
#include <sys/socket.h>

#include <stdexcept>

#include "smartmill_focas/client.h"

namespace smartmill::focas {
namespace {

constexpr int STREAM_SEND_BUFFER = 4096;  // [byte] small, so that a cancel is delivered soon
constexpr double CLOSE_TIMEOUT = 0.2;     // [s]
constexpr std::size_t READ_STEP = 1 << 17;

}  // namespace

std::string failureLine(const std::string& call, int code, int detail) {
  return call + ": " + ewName(code) + " (" + std::to_string(code) + "), detail " + std::to_string(detail);
}

void Connection::setTarget(const std::string& host, std::uint16_t port, double timeout) {
  host_ = host;
  port_ = port;
  timeout_ = timeout;
}

std::string Connection::where() const {
  return host_ + ":" + std::to_string(port_);
}

void Connection::drop() {
  stream.drop();
  data.drop();
}

void Connection::close() {
  for (Circuit* circuit : {&stream, &data}) {
    if (!circuit->valid()) {
      continue;
    }
    try {
      const Clock::time_point deadline = deadlineIn(CLOSE_TIMEOUT);
      queue(*circuit, FRAME_CLOSE, DIR_REQUEST, {});
      flushUntil(*circuit, deadline);
      while (receive(*circuit, deadline).type != FRAME_CLOSE) {
      }
    } catch (const std::exception&) {
      // The connection is already lost.
    }
  }
  drop();
}

void Connection::requireConnected() {
  if (!valid()) {
    drop();
    throw ConnectionError("not connected to the controller at " + where());
  }
}

void Connection::fail(const std::string& reason) {
  drop();
  throw ConnectionError("connection to the controller at " + where() + " lost: " + reason);
}

OpenReply Connection::open(Circuit& circuit) {
  const Clock::time_point deadline = deadlineIn(timeout_);
  circuit.drop();
  connectSocket(circuit, deadline);
  const std::uint16_t code = &circuit == &stream ? STREAM_CIRCUIT : DATA_CIRCUIT;
  queue(circuit, FRAME_OPEN, DIR_REQUEST, Writer().u16(code).data());
  flushUntil(circuit, deadline);
  for (;;) {
    const Frame frame = receive(circuit, deadline);
    if (frame.type != FRAME_OPEN) {
      continue;
    }
    if (frame.direction == DIR_ERROR) {
      const ErrorBody error = decodeErrorBody(frame.body);
      drop();
      throw FocasError("controller at " + where() +
                           " refuses the connection (all its sessions may be taken): " + ewName(error.code) +
                           " (" + std::to_string(error.code) + ")",
                       error.code, error.detail1);
    }
    return decodeOpenReply(frame.body);
  }
}

void Connection::connectSocket(Circuit& circuit, Clock::time_point deadline) {
  const bool is_stream = &circuit == &stream;
  try {
    circuit.socket = connectTo(host_, port_, deadline, [&](int fd) {
      keepAlive(fd, is_stream ? UNRESPONSIVE_PROBES : KEEP_ALIVE_PROBES);
      if (is_stream) {
        ::setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &STREAM_SEND_BUFFER, sizeof STREAM_SEND_BUFFER);
      }
    });
  } catch (const std::runtime_error& error) {
    drop();
    throw ConnectionError("cannot connect to the controller at " + where() + ": " + error.what());
  }
}

void Connection::queue(Circuit& circuit, std::uint8_t type, std::uint8_t direction, const Bytes& body) {
  const Bytes frame = encodeFrame(type, direction, body, REQUEST_VERSION);
  circuit.unsent.insert(circuit.unsent.end(), frame.begin(), frame.end());
}

bool Connection::flush(Circuit& circuit) {
  const Transfer result = writeSome(circuit.socket.get(), circuit.unsent);
  if (result == Transfer::closed) {
    fail("the controller closed it");
  }
  return result == Transfer::done;
}

void Connection::flushUntil(Circuit& circuit, Clock::time_point deadline) {
  while (!flush(circuit)) {
    if (Clock::now() >= deadline) {
      fail("the controller accepts no data");
    }
    pollfd wait{circuit.socket.get(), POLLOUT, 0};
    ::poll(&wait, 1, millisecondsUntil(deadline));
  }
}

std::optional<Frame> Connection::poll(Circuit& circuit) {
  std::optional<Frame> frame = circuit.reader.next();
  if (frame) {
    return frame;
  }
  const Transfer result = readSome(circuit.socket.get(), circuit.reader, READ_STEP);
  frame = circuit.reader.next();
  if (!frame && result == Transfer::closed) {
    fail("the controller closed it");
  }
  return frame;
}

std::optional<Frame> Connection::pollOrDrop(Circuit& circuit) {
  try {
    return poll(circuit);
  } catch (const WireError& e) {
    fail(e.what());
  }
}

Frame Connection::receive(Circuit& circuit, Clock::time_point deadline) {
  const auto timeout = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(timeout_));
  for (;;) {
    if (std::optional<Frame> frame = poll(circuit)) {
      // Endless other frames are no answer either.
      if (Clock::now() >= deadline + timeout) {
        fail("no answer in time");
      }
      if (frame->version < 1) {
        throw WireError("reply with version 0");
      }
      return std::move(*frame);
    }
    if (Clock::now() >= deadline) {
      fail("no answer in time");
    }
    pollfd wait{circuit.socket.get(), POLLIN, 0};
    ::poll(&wait, 1, millisecondsUntil(deadline));
  }
}

}  // namespace smartmill::focas
