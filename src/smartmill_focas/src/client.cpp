#include "smartmill_focas/client.h"

#include "client_impl.h"

namespace smartmill::focas {

void Client::Impl::connect(const std::string& host, std::uint16_t port, double timeout) {
  connection.drop();
  connection.setTarget(host, port, timeout);
  try {
    connection.open(connection.stream);
    const OpenReply reply = connection.open(connection.data);
    info = ControllerInfo();
    info.spindles = reply.spindles;
    info.spindle_meter = reply.spindle_meter;
    readSystemInfo(reply);
  } catch (const WireError& e) {
    connection.drop();
    throw ConnectionError("controller at " + connection.where() + ": " + e.what());
  } catch (...) {
    connection.drop();
    throw;
  }
}

std::vector<SubReply> Client::Impl::exchange(const std::vector<SubRequest>& requests) {
  connection.requireConnected();
  try {
    Connection::queue(connection.data, FRAME_DATA, DIR_REQUEST, encodeRequests(requests));
    const Clock::time_point deadline = deadlineIn(connection.timeout());
    connection.flushUntil(connection.data, deadline);
    return receiveReplies(requests, deadline);
  } catch (const WireError& e) {
    connection.drop();
    throw ConnectionError("controller at " + connection.where() + ": " + e.what());
  }
}

std::vector<SubReply> Client::Impl::receiveReplies(const std::vector<SubRequest>& requests,
                                                   Clock::time_point deadline) {
  Frame frame = connection.receive(connection.data, deadline);
  while (frame.type != FRAME_DATA) {
    frame = connection.receive(connection.data, deadline);
  }
  if (frame.direction == DIR_ERROR) {
    const ErrorBody error = decodeErrorBody(frame.body);
    const std::string call = "controller at " + connection.where() + " refuses a data request";
    throw FocasError(failureLine(call, error.code, error.detail1), error.code, error.detail1);
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

const Bytes& Client::Impl::dataOf(const std::string& call, const SubReply& reply) {
  if (reply.code != EW_OK) {
    throw FocasError(failureLine(call, reply.code, reply.detail), reply.code, reply.detail);
  }
  return reply.data;
}

Bytes Client::Impl::request(const std::string& call, const SubRequest& request) {
  return dataOf(call, exchange({request}).front());
}

std::vector<double> Client::Impl::values(const std::string& call, const Bytes& data, std::size_t at_most) {
  return decode(call, data, [&](Reader& reader) {
    std::vector<double> result;
    while (result.size() < at_most && reader.remaining() >= 8) {
      result.push_back(reader.value8().toDouble());
    }
    if (result.empty() && at_most > 0) {
      reader.skip(8);  // throws with the missing size
    }
    return result;
  });
}

void Client::Impl::readSystemInfo(const OpenReply& open_reply) {
  const Bytes data = request("cnc_sysinfo", SubRequest(OP_SYSTEM_INFO));
  decode("cnc_sysinfo", data, [&](Reader& reader) {
    reader.skip(4);
    info.cnc_type = reader.line(2);
    info.mt_type = reader.line(2);
    info.series = reader.line(4);
    info.version = reader.line(4);
    const std::string count = reader.text(2);
    int axes = 0;
    for (char c : count) {
      axes = c >= '0' && c <= '9' ? axes * 10 + (c - '0') : axes;
    }
    info.axes = axes > 0 ? axes : open_reply.axes;
    return 0;
  });
}

Client::Client() : impl_(std::make_unique<Impl>()) {
}
Client::~Client() = default;

void Client::connect(const std::string& host, std::uint16_t port, double timeout) {
  impl_->connect(host, port, timeout);
}
bool Client::connected() const {
  return impl_->connection.valid();
}
void Client::close() {
  impl_->connection.close();
}
void Client::drop() {
  impl_->connection.drop();
}
const ControllerInfo& Client::info() const {
  return impl_->info;
}

std::vector<SubReply> Client::exchange(const std::vector<SubRequest>& requests) {
  return impl_->exchange(requests);
}

void Client::dncStart() {
  impl_->dnc.start();
}
std::size_t Client::dncSend(const char* data, std::size_t size) {
  return impl_->dnc.send(data, size);
}
std::size_t Client::dncFlush() {
  return impl_->dnc.flush();
}
void Client::dncEnd(double timeout) {
  impl_->dnc.end(timeout);
}
void Client::dncCancel(DncResult result) {
  impl_->dnc.cancel(result);
}
bool Client::dncOpen() const {
  return impl_->dnc.isOpen();
}
bool Client::dncDeaf() const {
  return impl_->dnc.unresponsive();
}

void Client::dncCheck() {
  impl_->dnc.check();
}

}  // namespace smartmill::focas
