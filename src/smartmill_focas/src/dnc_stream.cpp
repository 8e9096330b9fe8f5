#include "dnc_stream.h"

#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <thread>

#include "smartmill_focas/client.h"

namespace smartmill::focas {
namespace {

constexpr int MAX_UNSOLICITED = 1000;  // unsolicited frames in sequence
constexpr int ARRIVAL_MS = 50;         // longer than the delayed acknowledgement of TCP

/// Whether the controller's side has acknowledged all bytes sent; if not, its receive buffer is full.
bool hasArrived(int fd) {
  for (int i = 0; i < ARRIVAL_MS; ++i) {
    int waiting = 0;
    if (::ioctl(fd, TIOCOUTQ, &waiting) != 0 || waiting == 0) {
      return true;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return false;
}

}  // namespace

void DncStream::requireSession(const std::string& call) {
  connection_.requireConnected();
  if (!isOpen()) {
    throw FocasError(call + ": no DNC session is open", EW_FUNC);
  }
}

void DncStream::start() {
  connection_.requireConnected();
  open_ = false;
  Circuit& stream = connection_.stream;
  const Clock::time_point deadline = deadlineIn(connection_.timeout());
  try {
    // Discards frames of a previous session, e.g. an unsolicited abort.
    for (int count = 0; connection_.poll(stream); ++count) {
      if (count > MAX_UNSOLICITED) {
        connection_.fail("too many unsolicited frames");
      }
    }
    Connection::queue(stream, FRAME_DNC_START, DIR_REQUEST,
                      Writer().u32(1).zeros(STREAM_NAME_BODY - 4).data());
    connection_.flushUntil(stream, deadline);
    for (;;) {
      const Frame frame = connection_.receive(stream, deadline);
      if (frame.is(FRAME_DNC_START, DIR_REPLY)) {
        break;
      }
      if (frame.is(FRAME_DNC_START, DIR_ERROR)) {
        const ErrorBody error = decodeErrorBody(frame.body);
        throw FocasError(failureLine("cnc_dncstart2", error.code, error.detail1), error.code, error.detail1);
      }
    }
  } catch (const WireError& e) {
    connection_.drop();
    throw ConnectionError("controller at " + connection_.where() + ": " + e.what());
  }
  open_ = true;
}

std::size_t DncStream::send(const char* text, std::size_t size) {
  requireSession("cnc_dnc2");
  check();
  std::size_t taken = 0;
  while (taken < size) {
    // Unsent text remains queued until the next call, so that cancel() can detect it.
    if (!connection_.flush(connection_.stream)) {
      return taken;
    }
    const std::size_t chunk = std::min(size - taken, DNC_CHUNK);
    Connection::queue(connection_.stream, FRAME_DNC_DATA, DIR_STREAM,
                      Bytes(text + taken, text + taken + chunk));
    taken += chunk;
  }
  connection_.flush(connection_.stream);
  return taken;
}

std::size_t DncStream::flush() {
  requireSession("cnc_dnc2");
  check();
  connection_.flush(connection_.stream);
  return connection_.stream.unsent.size();
}

void DncStream::endBegin() {
  requireSession("cnc_dncend2");
  Connection::queue(connection_.stream, FRAME_DNC_END, DIR_REQUEST, {});
  connection_.flush(connection_.stream);
}

bool DncStream::endDone() {
  requireSession("cnc_dncend2");
  connection_.flush(connection_.stream);
  while (const std::optional<Frame> frame = connection_.pollOrDrop(connection_.stream)) {
    if (frame->is(FRAME_DNC_END, DIR_REPLY)) {
      open_ = false;
      return true;
    }
    throwIfAbort(*frame, "cnc_dncend2");
  }
  return false;
}

void DncStream::end(double timeout) {
  const Clock::time_point deadline = deadlineIn(timeout < 0.0 ? connection_.timeout() : timeout);
  endBegin();
  while (!endDone()) {
    const Circuit& stream = connection_.stream;
    if (Clock::now() >= deadline) {
      connection_.drop();
      throw ConnectionError("cnc_dncend2: no answer from " + connection_.where() + " in time");
    }
    const short events = static_cast<short>(stream.unsent.empty() ? POLLIN : POLLIN | POLLOUT);
    pollfd wait{stream.socket.get(), events, 0};
    ::poll(&wait, 1, millisecondsUntil(deadline));
  }
}

void DncStream::cancel(DncResult result) {
  if (!isOpen()) {
    return;
  }
  open_ = false;
  Circuit& stream = connection_.stream;
  const bool blocked = !stream.unsent.empty() || !hasArrived(stream.socket.get());
  if (!blocked) {
    Connection::queue(stream, FRAME_DNC_CANCEL, DIR_STREAM, Writer().i16(0).i16(result).i16(0).i16(0).data());
  }
  if (blocked || !connection_.flush(stream)) {
    // A cancel frame and the normal end of the connection would be queued after the text that the controller
    // does not accept. With zero linger time the connection is reset at once.
    const linger at_once{1, 0};
    ::setsockopt(stream.socket.get(), SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
    connection_.open(stream);
  }
}

void DncStream::check() {
  connection_.requireConnected();
  int count = 0;
  while (const std::optional<Frame> frame = connection_.pollOrDrop(connection_.stream)) {
    throwIfAbort(*frame, "cnc_dnc2");
    if (++count > MAX_UNSOLICITED) {
      connection_.fail("too many unsolicited frames");
    }
  }
}

/// End of a session by the controller: 1903, 1a03 or 1b03.
void DncStream::throwIfAbort(const Frame& frame, const std::string& call) {
  if (frame.direction != DIR_ERROR || !open_ ||
      (frame.type != FRAME_DNC_START && frame.type != FRAME_DNC_DATA && frame.type != FRAME_DNC_END)) {
    return;
  }
  const ErrorBody error = decodeErrorBody(frame.body);
  open_ = false;
  if (!connection_.stream.unsent.empty()) {
    // A frame may be partly sent. The controller discards the text of the session, but must get complete
    // frames.
    connection_.flush(connection_.stream);
  }
  throw FocasError(failureLine(call, error.code, error.detail1), error.code, error.detail1);
}

}  // namespace smartmill::focas
