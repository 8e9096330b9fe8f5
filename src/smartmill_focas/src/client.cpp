#include "smartmill_focas/client.h"

#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <limits>

#include "socket.h"

namespace smartmill::focas {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int STREAM_SEND_BUFFER = 4096;  // [byte] little text on its way, so that a cancel is soon heard
constexpr double CLOSE_TIMEOUT = 0.2;     // [s]
constexpr std::size_t NAME_WIDTH = 4;     // [byte]
constexpr std::size_t READ_STEP = 1 << 17;

std::string failure(const std::string& call, int code, int detail) {
  return call + ": " + ewName(code) + " (" + std::to_string(code) + "), detail " + std::to_string(detail);
}

int millisecondsUntil(Clock::time_point deadline) {
  const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(deadline - Clock::now()).count();
  return static_cast<int>(std::clamp<long long>(left + 1, 0, 3600000));
}

Clock::time_point deadlineIn(double seconds) {
  return Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

std::string name(Reader& reader) {
  std::string text = reader.text(NAME_WIDTH);
  text.erase(std::find_if(text.rbegin(), text.rend(), [](char c) { return c > ' '; }).base(), text.end());
  return text;
}

std::string hostPort(const std::string& host, std::uint16_t port) {
  return host + ":" + std::to_string(port);
}

/// One TCP connection, opened with a code.
struct Circuit {
  Descriptor socket;
  FrameReader reader;
  Bytes unsent;

  bool valid() const { return socket.valid(); }
  void drop() {
    socket.reset();
    reader = FrameReader();
    unsent.clear();
  }
};

}  // namespace

class Client::Impl {
 public:
  void connect(const std::string& host, std::uint16_t port, double timeout) {
    drop();
    host_ = host;
    port_ = port;
    timeout_ = timeout;
    try {
      open(stream_, STREAM_CIRCUIT);
      const OpenReply reply = open(data_, DATA_CIRCUIT);
      info_ = ControllerInfo();
      info_.spindles = reply.spindles;
      info_.spindle_meter = reply.spindle_meter;
      readSystemInfo(reply);
    } catch (const WireError& e) {
      drop();
      throw ConnectionError("controller at " + where() + ": " + e.what());
    } catch (...) {
      drop();
      throw;
    }
  }

  bool connected() const { return stream_.valid() && data_.valid(); }

  void drop() {
    stream_.drop();
    data_.drop();
    dnc_open_ = false;
  }

  void close() {
    for (Circuit* circuit : {&stream_, &data_}) {
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
        // Gone already: nothing to say goodbye to.
      }
    }
    drop();
  }

  const ControllerInfo& info() const { return info_; }

  std::vector<SubReply> exchange(const std::vector<SubRequest>& requests) {
    need(data_);
    try {
      queue(data_, FRAME_DATA, DIR_REQUEST, encodeRequests(requests));
      const Clock::time_point deadline = deadlineIn(timeout_);
      flushUntil(data_, deadline);
      for (;;) {
        const Frame frame = receive(data_, deadline);
        if (frame.type != FRAME_DATA) {
          continue;
        }
        if (frame.direction == DIR_ERROR) {
          const ErrorBody error = decodeErrorBody(frame.body);
          throw FocasError(
              failure("controller at " + where() + " refuses a data request", error.code, error.detail1),
              error.code, error.detail1);
        }
        std::vector<SubReply> replies = decodeReplies(frame.body);
        if (replies.size() != requests.size()) {
          throw WireError(std::to_string(replies.size()) + " replies to " + std::to_string(requests.size()) +
                          " requests");
        }
        for (std::size_t i = 0; i < replies.size(); ++i) {
          if (replies[i].c3 != requests[i].c3) {
            throw WireError("reply " + std::to_string(i) + " answers another request");
          }
        }
        return replies;
      }
    } catch (const WireError& e) {
      drop();
      throw ConnectionError("controller at " + where() + ": " + e.what());
    }
  }

  /// Data of one reply. @throws FocasError naming the call.
  static const Bytes& good(const std::string& call, const SubReply& reply) {
    if (reply.code != EW_OK) {
      throw FocasError(failure(call, reply.code, reply.detail), reply.code, reply.detail);
    }
    return reply.data;
  }

  Bytes ask(const std::string& call, const SubRequest& request) {
    return good(call, exchange({request}).front());
  }

  /// Decodes with what the reader throws turned into a FocasError of this call.
  template <class Decode>
  auto decode(const std::string& call, const Bytes& data, Decode&& decoder) {
    try {
      Reader reader(data);
      return decoder(reader);
    } catch (const WireError& e) {
      throw FocasError(call + ": " + e.what(), EW_LENGTH);
    }
  }

  std::vector<double> values(const std::string& call, const Bytes& data, std::size_t at_most) {
    return decode(call, data, [&](Reader& reader) {
      std::vector<double> result;
      while (result.size() < at_most && reader.left() >= 8) {
        result.push_back(reader.value8().toDouble());
      }
      if (result.empty() && at_most > 0) {
        reader.skip(8);  // says what is missing
      }
      return result;
    });
  }

  std::size_t axes() const { return static_cast<std::size_t>(info_.axes); }
  std::size_t spindles() const { return static_cast<std::size_t>(info_.spindles); }
  double timeout() const { return timeout_; }

  // --- DNC

  void dncStart() {
    need(stream_);
    const Clock::time_point deadline = deadlineIn(timeout_);
    try {
      // What a former session left (an abort nobody asked for) must not answer this one.
      while (pollFrame(stream_)) {
      }
      queue(stream_, FRAME_DNC_START, DIR_REQUEST, Writer().u32(1).zeros(STREAM_NAME_BODY - 4).data());
      flushUntil(stream_, deadline);
      for (;;) {
        const Frame frame = receive(stream_, deadline);
        if (frame.is(FRAME_DNC_START, DIR_REPLY)) {
          break;
        }
        if (frame.is(FRAME_DNC_START, DIR_ERROR)) {
          const ErrorBody error = decodeErrorBody(frame.body);
          throw FocasError(failure("cnc_dncstart2", error.code, error.detail1), error.code, error.detail1);
        }
      }
    } catch (const WireError& e) {
      drop();
      throw ConnectionError("controller at " + where() + ": " + e.what());
    }
    dnc_open_ = true;
  }

  std::size_t dncSend(const char* text, std::size_t size) {
    needSession("cnc_dnc2");
    dncCheck();
    std::size_t taken = 0;
    while (taken < size && flush(stream_)) {
      const std::size_t piece = std::min(size - taken, DNC_CHUNK);
      queue(stream_, FRAME_DNC_DATA, DIR_STREAM, Bytes(text + taken, text + taken + piece));
      taken += piece;
    }
    flush(stream_);
    return taken;
  }

  std::size_t dncFlush() {
    needSession("cnc_dnc2");
    dncCheck();
    flush(stream_);
    return stream_.unsent.size();
  }

  void dncEndBegin() {
    needSession("cnc_dncend2");
    queue(stream_, FRAME_DNC_END, DIR_REQUEST, {});
    flush(stream_);
  }

  bool dncEndDone() {
    needSession("cnc_dncend2");
    flush(stream_);
    while (std::optional<Frame> frame = pollFrameOrDrop()) {
      if (frame->is(FRAME_DNC_END, DIR_REPLY)) {
        dnc_open_ = false;
        return true;
      }
      throwIfAbort(*frame, "cnc_dncend2");
    }
    return false;
  }

  void dncEnd(double timeout) {
    const Clock::time_point deadline = deadlineIn(timeout < 0.0 ? timeout_ : timeout);
    dncEndBegin();
    while (!dncEndDone()) {
      if (Clock::now() >= deadline) {
        drop();
        throw ConnectionError("cnc_dncend2: no answer from " + where() + " in time");
      }
      const short events = static_cast<short>(stream_.unsent.empty() ? POLLIN : POLLIN | POLLOUT);
      pollfd wait{stream_.socket.get(), events, 0};
      ::poll(&wait, 1, millisecondsUntil(deadline));
    }
  }

  void dncCancel(DncResult result) {
    if (!dnc_open_) {
      return;
    }
    dnc_open_ = false;
    need(stream_);
    queue(stream_, FRAME_DNC_CANCEL, DIR_STREAM, Writer().i16(0).i16(result).i16(0).i16(0).data());
    if (!flush(stream_)) {
      // The stream is full: its end is the only word that still gets through.
      stream_.drop();
      open(stream_, STREAM_CIRCUIT);
    }
  }

  bool dncOpen() const { return dnc_open_; }

  void dncCheck() {
    need(stream_);
    while (std::optional<Frame> frame = pollFrameOrDrop()) {
      throwIfAbort(*frame, "cnc_dnc2");
    }
  }

 private:
  std::string where() const { return hostPort(host_, port_); }

  void need(const Circuit& circuit) {
    if (!circuit.valid() || !data_.valid() || !stream_.valid()) {
      drop();
      throw ConnectionError("not connected to the controller at " + where());
    }
  }

  void needSession(const std::string& call) {
    need(stream_);
    if (!dnc_open_) {
      throw FocasError(call + ": no DNC session is open", EW_FUNC);
    }
  }

  [[noreturn]] void lost(const std::string& why) {
    drop();
    throw ConnectionError("connection to the controller at " + where() + " lost: " + why);
  }

  OpenReply open(Circuit& circuit, std::uint16_t code) {
    const Clock::time_point deadline = deadlineIn(timeout_);
    circuit.drop();
    connectSocket(circuit, code == STREAM_CIRCUIT, deadline);
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
                             " refuses the connection (all its sessions may be taken): " +
                             ewName(error.code) + " (" + std::to_string(error.code) + ")",
                         error.code, error.detail1);
      }
      if (frame.version < 1) {
        throw WireError("reply with version 0");
      }
      return decodeOpenReply(frame.body);
    }
  }

  void connectSocket(Circuit& circuit, bool stream, Clock::time_point deadline) {
    const auto fail = [&](const std::string& why) {
      drop();
      throw ConnectionError("cannot connect to the controller at " + where() + ": " + why);
    };
    addrinfo hints{};
    hints.ai_family = AF_INET;
    hints.ai_socktype = SOCK_STREAM;
    addrinfo* found = nullptr;
    const int resolved = ::getaddrinfo(host_.c_str(), std::to_string(port_).c_str(), &hints, &found);
    if (resolved != 0) {
      fail(::gai_strerror(resolved));
    }
    circuit.socket = Descriptor(::socket(AF_INET, SOCK_STREAM, 0));
    int error = circuit.socket.valid() ? 0 : errno;
    if (error == 0) {
      prepareSocket(circuit.socket.get());
      if (stream) {
        ::setsockopt(circuit.socket.get(), SOL_SOCKET, SO_SNDBUF, &STREAM_SEND_BUFFER,
                     sizeof STREAM_SEND_BUFFER);
      }
      if (::connect(circuit.socket.get(), found->ai_addr, found->ai_addrlen) != 0) {
        error = errno;
      }
    }
    ::freeaddrinfo(found);
    if (error == EINPROGRESS) {
      pollfd wait{circuit.socket.get(), POLLOUT, 0};
      int ready = 0;
      do {
        ready = ::poll(&wait, 1, millisecondsUntil(deadline));
      } while (ready < 0 && errno == EINTR);
      if (ready == 0) {
        fail("no answer in time");
      }
      socklen_t size = sizeof error;
      error = 0;
      ::getsockopt(circuit.socket.get(), SOL_SOCKET, SO_ERROR, &error, &size);
    }
    if (error != 0) {
      fail(errorText(error));
    }
  }

  static void queue(Circuit& circuit, std::uint8_t type, std::uint8_t direction, const Bytes& body) {
    const Bytes frame = encodeFrame(type, direction, body, REQUEST_VERSION);
    circuit.unsent.insert(circuit.unsent.end(), frame.begin(), frame.end());
  }

  /// True when all went out.
  bool flush(Circuit& circuit) {
    const Transfer result = writeSome(circuit.socket.get(), circuit.unsent);
    if (result == Transfer::closed) {
      // The controller may have said why before it closed.
      lost("the controller closed it");
    }
    return result == Transfer::done;
  }

  void flushUntil(Circuit& circuit, Clock::time_point deadline) {
    while (!flush(circuit)) {
      if (Clock::now() >= deadline) {
        lost("it takes no data");
      }
      pollfd wait{circuit.socket.get(), POLLOUT, 0};
      ::poll(&wait, 1, millisecondsUntil(deadline));
    }
  }

  /// A frame that is there now.
  std::optional<Frame> pollFrame(Circuit& circuit) {
    std::optional<Frame> frame = circuit.reader.next();
    if (frame) {
      return frame;
    }
    const Transfer result = readSome(circuit.socket.get(), circuit.reader, READ_STEP);
    frame = circuit.reader.next();
    if (!frame && result == Transfer::closed) {
      lost("the controller closed it");
    }
    return frame;
  }

  std::optional<Frame> pollFrameOrDrop() {
    try {
      return pollFrame(stream_);
    } catch (const WireError& e) {
      lost(e.what());
    }
  }

  Frame receive(Circuit& circuit, Clock::time_point deadline) {
    for (;;) {
      if (std::optional<Frame> frame = pollFrame(circuit)) {
        return std::move(*frame);
      }
      if (Clock::now() >= deadline) {
        lost("no answer in time");
      }
      pollfd wait{circuit.socket.get(), POLLIN, 0};
      ::poll(&wait, 1, millisecondsUntil(deadline));
    }
  }

  /// The controller's own end of a session: 1903, 1a03 or 1b03.
  void throwIfAbort(const Frame& frame, const std::string& call) {
    if (frame.direction != DIR_ERROR || !dnc_open_ ||
        (frame.type != FRAME_DNC_START && frame.type != FRAME_DNC_DATA && frame.type != FRAME_DNC_END)) {
      return;
    }
    const ErrorBody error = decodeErrorBody(frame.body);
    dnc_open_ = false;
    if (!stream_.unsent.empty()) {
      // A frame may be half out; the controller drops the session's text anyway, but must get whole frames.
      flush(stream_);
    }
    throw FocasError(failure(call, error.code, error.detail1), error.code, error.detail1);
  }

  void readSystemInfo(const OpenReply& open_reply) {
    const Bytes data = ask("cnc_sysinfo", SubRequest(OP_SYSTEM_INFO));
    decode("cnc_sysinfo", data, [&](Reader& reader) {
      reader.skip(4);
      info_.cnc_type = reader.text(2);
      info_.mt_type = reader.text(2);
      info_.series = reader.text(4);
      info_.version = reader.text(4);
      const std::string count = reader.text(2);
      int axes = 0;
      for (char c : count) {
        axes = c >= '0' && c <= '9' ? axes * 10 + (c - '0') : axes;
      }
      info_.axes = axes > 0 ? axes : open_reply.axes;
      return 0;
    });
  }

  std::string host_;
  std::uint16_t port_ = 0;
  double timeout_ = 1.0;  // [s]
  Circuit stream_, data_;
  ControllerInfo info_;
  bool dnc_open_ = false;
};

Client::Client() : impl_(std::make_unique<Impl>()) {
}
Client::~Client() = default;

void Client::connect(const std::string& host, std::uint16_t port, double timeout) {
  impl_->connect(host, port, timeout);
}
bool Client::connected() const {
  return impl_->connected();
}
void Client::close() {
  impl_->close();
}
void Client::drop() {
  impl_->drop();
}
const ControllerInfo& Client::info() const {
  return impl_->info();
}

std::vector<SubReply> Client::exchange(const std::vector<SubRequest>& requests) {
  return impl_->exchange(requests);
}

Status Client::statusInfo() {
  const std::vector<SubReply> replies =
      exchange({SubRequest(OP_STATUS), SubRequest(OP_HDCK), SubRequest(OP_TMMODE)});
  Status status = impl_->decode("cnc_statinfo", Impl::good("cnc_statinfo", replies[0]),
                                [](Reader& reader) { return decodeStatus(reader); });
  // The two others may be refused.
  if (replies[1].code == EW_OK && replies[1].data.size() >= 2) {
    status.hdck = Reader(replies[1].data).i16();
  }
  if (replies[2].code == EW_OK && replies[2].data.size() >= 2) {
    status.tmmode = Reader(replies[2].data).i16();
  }
  return status;
}

std::vector<double> Client::position(PositionKind kind, int axis) {
  const std::string call = "position of kind " + std::to_string(kind);
  const std::size_t due = axis == -1 ? impl_->axes() : 1;
  std::vector<double> result =
      impl_->values(call, impl_->ask(call, SubRequest(OP_POSITION, kind, axis)), due);
  if (result.size() != due) {
    throw FocasError(
        call + ": " + std::to_string(result.size()) + " values, " + std::to_string(due) + " are due",
        EW_LENGTH);
  }
  return result;
}

double Client::actualFeed() {
  return impl_->values("cnc_actf", impl_->ask("cnc_actf", SubRequest(OP_ACTUAL_FEED)), 1).front();
}

double Client::actualSpeed() {
  return impl_->values("cnc_acts", impl_->ask("cnc_acts", SubRequest(OP_ACTUAL_SPEED)), 1).front();
}

std::vector<double> Client::actualSpeeds(int spindle) {
  const std::vector<SubReply> replies = exchange(
      {SubRequest(OP_LOCK, 1), SubRequest(OP_SPINDLE, SPINDLE_SPEED, spindle), SubRequest(OP_LOCK, 1)});
  return impl_->values("cnc_acts2", Impl::good("cnc_acts2", replies[1]),
                       spindle == -1 ? impl_->spindles() : 1);
}

std::vector<double> Client::spindleLoad(int spindle) {
  const std::vector<SubReply> replies = exchange(
      {SubRequest(OP_LOCK, 1), SubRequest(OP_SPINDLE, SPINDLE_LOAD, spindle), SubRequest(OP_LOCK, 1)});
  return impl_->values("cnc_rdspload", Impl::good("cnc_rdspload", replies[1]),
                       spindle == -1 ? impl_->spindles() : 1);
}

LoadMeter Client::spindleMeter() {
  const std::string call = "cnc_rdspmeter";
  const std::vector<SubReply> replies =
      exchange({SubRequest(OP_LOCK, 1), SubRequest(OP_SPINDLE_NAMES, -1),
                SubRequest(OP_SPINDLE, SPINDLE_METER_LOAD, -1),
                SubRequest(OP_SPINDLE, SPINDLE_METER_SPEED, -1), SubRequest(OP_LOCK, 1)});
  LoadMeter meter;
  meter.load = impl_->values(call, Impl::good(call, replies[2]), impl_->spindles());
  meter.speed = impl_->values(call, Impl::good(call, replies[3]), impl_->spindles());
  meter.names = decodeNames(replies[1], meter.load.size());
  return meter;
}

LoadMeter Client::servoMeter() {
  const std::string call = "cnc_rdsvmeter";
  const std::vector<SubReply> replies = exchange({SubRequest(OP_LOCK, 2), SubRequest(OP_AXIS_NAMES, 0),
                                                  SubRequest(OP_SERVO, 1), SubRequest(OP_LOCK, 2)});
  LoadMeter meter;
  meter.load = impl_->values(call, Impl::good(call, replies[2]), impl_->axes());
  meter.names = decodeNames(replies[1], meter.load.size());
  for (double& load : meter.load) {
    load = std::abs(load);
  }
  return meter;
}

std::vector<std::string> Client::axisNames() {
  const SubReply reply = exchange({SubRequest(OP_AXIS_NAMES, 0)}).front();
  Impl::good("axis names", reply);
  return decodeNames(reply, impl_->axes());
}

std::optional<double> Client::readMacro(int number) {
  const std::string call = "cnc_rdmacro " + std::to_string(number);
  const double value =
      impl_->values(call, impl_->ask(call, SubRequest(OP_READ_MACRO, number, number)), 1).front();
  return std::isnan(value) ? std::nullopt : std::optional<double>(value);
}

void Client::writeMacro(int number, std::optional<double> value) {
  const Value8 coded = Value8::fromMacro(value);
  impl_->ask("cnc_wrmacro " + std::to_string(number),
             SubRequest(OP_WRITE_MACRO, number, number, 0, 0, Writer().value8(coded).data()));
}

std::vector<double> Client::readMacros(int first, int count) {
  const std::string call = "cnc_rdmacror2 " + std::to_string(first);
  const Bytes data = impl_->ask(call, SubRequest(OP_READ_MACRO_DOUBLE, first, count));
  return impl_->decode(call, data, [&](Reader& reader) {
    std::vector<double> values(static_cast<std::size_t>(count));
    for (double& value : values) {
      value = reader.f64();
    }
    return values;
  });
}

void Client::writeMacros(int first, const std::vector<double>& values) {
  Writer extra;
  for (double value : values) {
    extra.f64(value);
  }
  impl_->ask("cnc_wrmacror2 " + std::to_string(first),
             SubRequest(OP_WRITE_MACRO_DOUBLE, first, 0, 0, 0, extra.data()));
}

std::uint32_t Client::alarmBits() {
  return impl_->decode("cnc_alarm", impl_->ask("cnc_alarm", SubRequest(OP_ALARM)),
                       [](Reader& reader) { return reader.u32(); });
}

std::vector<AlarmMessage> Client::alarmMessages() {
  constexpr int MOST = 10;
  constexpr int TEXT_WIDTH = 64;
  constexpr std::size_t ENTRY = 16 + TEXT_WIDTH;
  const Bytes data = impl_->ask("cnc_rdalmmsg2", SubRequest(OP_ALARM_MESSAGES, -1, MOST, 2, TEXT_WIDTH));
  return impl_->decode("cnc_rdalmmsg2", data, [&](Reader& reader) {
    std::vector<AlarmMessage> alarms;
    while (reader.left() >= ENTRY) {
      AlarmMessage alarm;
      alarm.number = reader.i32();
      alarm.type = reader.i32();
      alarm.axis = reader.i32();
      const std::int32_t length = reader.i32();
      alarm.text = reader.text(TEXT_WIDTH);
      alarm.text.resize(std::min(alarm.text.size(), static_cast<std::size_t>(std::max(length, 0))));
      alarms.push_back(std::move(alarm));
    }
    return alarms;
  });
}

void Client::programNumber(int* running, int* main_program) {
  impl_->decode("cnc_rdprgnum", impl_->ask("cnc_rdprgnum", SubRequest(OP_PROGRAM_NUMBER)),
                [&](Reader& reader) {
                  *running = reader.i32();
                  *main_program = reader.i32();
                  return 0;
                });
}

int Client::sequenceNumber() {
  return impl_->decode("cnc_rdseqnum", impl_->ask("cnc_rdseqnum", SubRequest(OP_SEQUENCE_NUMBER)),
                       [](Reader& reader) { return reader.i32(); });
}

std::string Client::executingBlock() {
  constexpr int MOST = 256;
  return impl_->decode("cnc_rdexecprog", impl_->ask("cnc_rdexecprog", SubRequest(OP_EXECUTING_BLOCK, MOST)),
                       [](Reader& reader) {
                         reader.skip(4);
                         return reader.text(reader.left());
                       });
}

void Client::reset() {
  impl_->ask("cnc_reset", SubRequest(OP_RESET));
}
void Client::cycleStart() {
  impl_->ask("cnc_start", SubRequest(OP_START));
}

void Client::dncStart() {
  impl_->dncStart();
}
std::size_t Client::dncSend(const char* data, std::size_t size) {
  return impl_->dncSend(data, size);
}
std::size_t Client::dncFlush() {
  return impl_->dncFlush();
}
void Client::dncEnd(double timeout) {
  impl_->dncEnd(timeout);
}
void Client::dncEndBegin() {
  impl_->dncEndBegin();
}
bool Client::dncEndDone() {
  return impl_->dncEndDone();
}
void Client::dncCancel(DncResult result) {
  impl_->dncCancel(result);
}
bool Client::dncOpen() const {
  return impl_->dncOpen();
}
void Client::dncCheck() {
  impl_->dncCheck();
}

Status decodeStatus(Reader& reader) {
  Status status;
  status.aut = reader.i16();
  status.run = reader.i16();
  status.motion = reader.i16();
  status.mstb = reader.i16();
  status.emergency = reader.i16();
  status.alarm = reader.i16();
  status.edit = reader.i16();
  return status;
}

std::vector<std::string> decodeNames(const SubReply& reply, std::size_t at_most) {
  std::vector<std::string> names;
  Reader reader(reply.data);
  while (reply.code == EW_OK && names.size() < at_most && reader.left() >= NAME_WIDTH) {
    names.push_back(name(reader));
  }
  return names;
}

std::vector<double> decodeValues(const SubReply& reply, std::size_t at_most) {
  std::vector<double> values;
  Reader reader(reply.data);
  while (reply.code == EW_OK && values.size() < at_most && reader.left() >= 8) {
    values.push_back(reader.value8().toDouble());
  }
  return values;
}

}  // namespace smartmill::focas
