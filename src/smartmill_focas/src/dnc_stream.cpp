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

constexpr int MOST_UNASKED = 1000;  // frames that nobody asked for, one after the other
constexpr int ARRIVAL_MS = 50;      // longer than TCP puts off saying that something has arrived

/// Whether all that was sent has reached the controller's side; what waits here, it does not take.
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

void DncStream::needSession(const std::string& call) {
  connection_.need();
  if (!isOpen()) {
    throw FocasError(call + ": no DNC session is open", EW_FUNC);
  }
}

void DncStream::start() {
  connection_.need();
  open_ = false;
  Circuit& stream = connection_.stream;
  const Clock::time_point deadline = deadlineIn(connection_.timeout());
  try {
    // What a former session left (an abort nobody asked for) must not answer this one.
    for (int count = 0; connection_.poll(stream); ++count) {
      if (count > MOST_UNASKED) {
        connection_.lost("it sends frames without end");
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
  needSession("cnc_dnc2");
  check();
  std::size_t taken = 0;
  while (taken < size) {
    // Text that is held back stays held back until the next call: cancel() can tell by it.
    if (!connection_.flush(connection_.stream)) {
      return taken;
    }
    const std::size_t piece = std::min(size - taken, DNC_CHUNK);
    Connection::queue(connection_.stream, FRAME_DNC_DATA, DIR_STREAM,
                      Bytes(text + taken, text + taken + piece));
    taken += piece;
  }
  connection_.flush(connection_.stream);
  return taken;
}

std::size_t DncStream::flush() {
  needSession("cnc_dnc2");
  check();
  connection_.flush(connection_.stream);
  return connection_.stream.unsent.size();
}

void DncStream::endBegin() {
  needSession("cnc_dncend2");
  Connection::queue(connection_.stream, FRAME_DNC_END, DIR_REQUEST, {});
  connection_.flush(connection_.stream);
}

bool DncStream::endDone() {
  needSession("cnc_dncend2");
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
  const bool held_back = !stream.unsent.empty() || !hasArrived(stream.socket.get());
  if (!held_back) {
    Connection::queue(stream, FRAME_DNC_CANCEL, DIR_STREAM, Writer().i16(0).i16(result).i16(0).i16(0).data());
  }
  if (held_back || !connection_.flush(stream)) {
    // A word, and the end of the connection too, would come behind the text that the controller does not
    // take: with nothing to linger for, the end comes at once.
    const linger at_once{1, 0};
    ::setsockopt(stream.socket.get(), SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
    connection_.open(stream);
  }
}

void DncStream::check() {
  connection_.need();
  int count = 0;
  while (const std::optional<Frame> frame = connection_.pollOrDrop(connection_.stream)) {
    throwIfAbort(*frame, "cnc_dnc2");
    if (++count > MOST_UNASKED) {
      connection_.lost("it sends frames without end");
    }
  }
}

/// The controller's own end of a session: 1903, 1a03 or 1b03.
void DncStream::throwIfAbort(const Frame& frame, const std::string& call) {
  if (frame.direction != DIR_ERROR || !open_ ||
      (frame.type != FRAME_DNC_START && frame.type != FRAME_DNC_DATA && frame.type != FRAME_DNC_END)) {
    return;
  }
  const ErrorBody error = decodeErrorBody(frame.body);
  open_ = false;
  if (!connection_.stream.unsent.empty()) {
    // A frame may be half out; the controller drops the session's text anyway, but must get whole frames.
    connection_.flush(connection_.stream);
  }
  throw FocasError(failureLine(call, error.code, error.detail1), error.code, error.detail1);
}

}  // namespace smartmill::focas
