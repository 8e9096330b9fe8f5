#include "session.h"

#include <poll.h>

#include <algorithm>
#include <utility>

namespace smartmill::focas {
namespace {

constexpr std::size_t READ_STEP =
    8192;  // [byte] maximum to read from a connection before its frames are served
constexpr std::size_t MAX_UNSENT =
    1 << 18;  // [byte] of replies that a client has not read, above which it is not served
constexpr int SESSION_POLL_MS = 5;    // period of dncAbort()
constexpr int BLOCKED_POLL_MS = 2;    // period of offering text to a full buffer of the machine
constexpr int TOO_MANY_SESSIONS = 2;  // code with which a 31i refuses the sixth session

Bytes errorBody(int code) {
  ErrorBody error;
  error.code = static_cast<std::int16_t>(code);
  return encodeErrorBody(error);
}

bool containsEnd(const std::deque<Frame>& frames) {
  return std::any_of(frames.begin(), frames.end(), [](const Frame& frame) {
    return frame.type == FRAME_DNC_END || frame.type == FRAME_DNC_CANCEL;
  });
}

}  // namespace

short Session::events() const {
  short events = 0;
  if (!peer_closed_) {
    // While the buffer of the machine is full, the client is not read, so that TCP stops it; a disconnect is
    // still detected.
    events = static_cast<short>(blocked_ || unsent_.size() > MAX_UNSENT ? POLLRDHUP : POLLIN | POLLRDHUP);
  }
  return unsent_.empty() ? events : static_cast<short>(events | POLLOUT);
}

int Session::pollPeriod(int longest) const {
  if (blocked_) {
    return std::min(longest, BLOCKED_POLL_MS);
  }
  return dnc_ == Dnc::open || transfer_.uploading() ? std::min(longest, SESSION_POLL_MS) : longest;
}

void Session::drop() {
  if (std::exchange(dnc_, Dnc::none) == Dnc::open) {
    shared_.controller.dnc.dncDisconnected();
  }
  dead_ = true;
}

void Session::serve(short events) {
  try {
    if ((events & (POLLERR | POLLNVAL)) != 0) {
      drop();
      return;
    }
    checkDnc();
    if ((events & (POLLIN | POLLRDHUP | POLLHUP)) != 0 && !peer_closed_) {
      read((events & (POLLRDHUP | POLLHUP)) != 0);
    }
    if (peer_closed_ && dnc_ == Dnc::open && !containsEnd(frames_)) {
      drop();
      return;
    }
    serveFrames();
    if (unsent_.empty()) {
      transfer_.push(sender());
    }
    if (!unsent_.empty() && writeSome(socket_.get(), unsent_) == Transfer::closed) {
      drop();
      return;
    }
    if ((peer_closed_ && frames_.empty() && !blocked_) || (close_when_sent_ && unsent_.empty())) {
      drop();
    }
  } catch (const std::exception&) {
    // No FOCAS data: the connection is unusable.
    drop();
  }
}

void Session::checkDnc() {
  if (dnc_ != Dnc::open) {
    return;
  }
  const int code = shared_.controller.dnc.dncAbort();
  if (code != EW_OK) {
    dnc_ = Dnc::aborted;
    abort_code_ = code;
    send(FRAME_DNC_DATA, DIR_ERROR, errorBody(code));
  }
}

/// Of a disconnected client at most one receive buffer remains; it is read at once, so that the end is
/// detected even while the buffer of the machine is full.
void Session::read(bool leaving) {
  peer_closed_ = readSome(socket_.get(), reader_, leaving ? SIZE_MAX : READ_STEP) == Transfer::closed;
  while (std::optional<Frame> frame = reader_.next()) {
    frames_.push_back(std::move(*frame));
  }
}

void Session::serveFrames() {
  blocked_ = false;
  while (!frames_.empty() && !close_when_sent_ && unsent_.size() <= MAX_UNSENT) {
    if (!serveFrame(frames_.front())) {
      blocked_ = true;
      return;
    }
    frames_.pop_front();
    text_taken_ = 0;
  }
}

/// @return false: the frame must wait for the buffer of the machine
bool Session::serveFrame(const Frame& frame) {
  if (frame.is(FRAME_OPEN, DIR_REQUEST)) {
    open(frame);
  } else if (frame.is(FRAME_CLOSE, DIR_REQUEST)) {
    if (std::exchange(dnc_, Dnc::none) == Dnc::open) {
      shared_.controller.dnc.dncDisconnected();
    }
    circuit_ = 0;
    reply(FRAME_CLOSE, EW_OK);
  } else if (circuit_ == 0) {
    if (frame.direction == DIR_REQUEST) {
      reply(frame.type, EW_HANDLE);
    }
  } else if (frame.is(FRAME_DATA, DIR_REQUEST)) {
    answerData(frame);
  } else if (circuit_ != STREAM_CIRCUIT || !transfer_.handle(frame, shared_.controller.programs, sender())) {
    return serveDnc(frame);
  }
  return true;
}

void Session::open(const Frame& frame) {
  const int circuit = frame.body.size() >= 2 ? Reader(frame.body).u16() : 0;
  const auto same = std::count_if(shared_.all.begin(), shared_.all.end(), [&](const Session& other) {
    return &other != this && other.circuit_ == circuit;
  });
  if ((circuit != STREAM_CIRCUIT && circuit != DATA_CIRCUIT) || same >= shared_.options.max_sessions) {
    reply(FRAME_OPEN, TOO_MANY_SESSIONS);
    close_when_sent_ = true;
    return;
  }
  circuit_ = circuit;
  OpenReply opened;
  opened.axes = static_cast<int>(shared_.info.axes.size());
  opened.spindles = static_cast<int>(shared_.info.spindles.size());
  send(FRAME_OPEN, DIR_REPLY, encodeOpenReply(opened));
}

void Session::answerData(const Frame& frame) {
  Bytes body;
  try {
    std::vector<SubReply> replies;
    for (const SubRequest& request : decodeRequests(frame.body)) {
      replies.push_back(shared_.calls.answer(request));
    }
    body = encodeReplies(replies);
  } catch (const WireError&) {
    reply(FRAME_DATA, EW_LENGTH);
    return;
  }
  send(FRAME_DATA, DIR_REPLY, body);
}

// --- DNC

/// @return false: the frame must wait for the buffer of the machine
bool Session::serveDnc(const Frame& frame) {
  if (frame.is(FRAME_DNC_START, DIR_REQUEST)) {
    reply(FRAME_DNC_START, startDnc());
  } else if (frame.is(FRAME_DNC_DATA, DIR_STREAM)) {
    if (dnc_ == Dnc::open) {
      const char* text = reinterpret_cast<const char*>(frame.body.data()) + text_taken_;
      const std::size_t size = frame.body.size() - text_taken_;
      text_taken_ += std::min(size, shared_.controller.dnc.dncData(text, size));
      return text_taken_ == frame.body.size();
    }
  } else if (frame.is(FRAME_DNC_END, DIR_REQUEST)) {
    reply(FRAME_DNC_END, endDnc());
  } else if (frame.is(FRAME_DNC_CANCEL, DIR_STREAM)) {
    if (dnc_ == Dnc::open) {
      const bool has_result = frame.body.size() >= 4;
      shared_.controller.dnc.dncCancel(has_result ? Reader(frame.body).skip(2).i16() : int{DNC_CANCEL});
    }
    dnc_ = Dnc::none;
  } else if (frame.direction == DIR_REQUEST) {
    reply(frame.type, EW_FUNC);
  }
  return true;
}

int Session::startDnc() {
  if (circuit_ != STREAM_CIRCUIT) {
    return EW_FUNC;
  }
  const bool taken = std::any_of(shared_.all.begin(), shared_.all.end(),
                                 [](const Session& other) { return other.dnc_ == Dnc::open; });
  const int code = taken ? int{EW_BUSY} : int{shared_.controller.dnc.dncStart()};
  dnc_ = code == EW_OK ? Dnc::open : dnc_;
  return code;
}

int Session::endDnc() {
  int code = EW_FUNC;
  if (dnc_ == Dnc::open) {
    code = shared_.controller.dnc.dncEnd();
  } else if (dnc_ == Dnc::aborted) {
    code = abort_code_;
  }
  dnc_ = Dnc::none;
  return code;
}

// --- sending

void Session::reply(std::uint8_t type, int code) {
  if (code == EW_OK) {
    send(type, DIR_REPLY, {});
  } else {
    send(type, DIR_ERROR, errorBody(code));
  }
}

void Session::send(std::uint8_t type, std::uint8_t direction, const Bytes& body) {
  const Bytes frame = encodeFrame(type, direction, body, REPLY_VERSION);
  unsent_.insert(unsent_.end(), frame.begin(), frame.end());
}

ProgramTransfer::Send Session::sender() {
  return [this](std::uint8_t type, Direction direction, const Bytes& body) { send(type, direction, body); };
}

}  // namespace smartmill::focas
