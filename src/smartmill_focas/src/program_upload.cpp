#include <cstdio>

#include "client_impl.h"

namespace smartmill::focas {
namespace {

constexpr std::size_t LONGEST = std::size_t{1} << 28;  // [byte]
constexpr int MAX_NUMBER = 99999999;

}  // namespace

/// The name of the predecessor of cnc_upstart4, which controls of all generations accept.
std::string Client::upload(int number, const std::function<bool(std::size_t)>& progress) {
  const std::string call = "upload of O" + std::to_string(number);
  if (number < 1 || number > MAX_NUMBER)
    throw FocasError(call + ": expected a number of 1 to " + std::to_string(MAX_NUMBER), EW_NUMBER);
  Connection& connection = impl_->connection;
  connection.requireConnected();
  if (impl_->dnc.isOpen()) throw FocasError(call + ": a DNC session is open", EW_BUSY);
  Circuit& stream = connection.stream;
  const auto deadline = [&] { return deadlineIn(connection.timeout()); };
  const auto send = [&](std::uint8_t type, std::uint8_t direction, const Bytes& body) {
    Connection::queue(stream, type, direction, body);
    connection.flushUntil(stream, deadline());
  };
  char name[32];
  std::snprintf(name, sizeof name, "O%04d-O%04d", number, number);
  std::string text;
  bool cancelled = false;
  try {
    send(FRAME_UPLOAD_START, DIR_REQUEST, Writer().u32(1).text(name, STREAM_NAME_BODY - 4).data());
    for (;;) {
      const Frame frame = connection.receive(stream, deadline());
      if (frame.type == FRAME_UPLOAD_START && frame.direction == DIR_ERROR) {
        const ErrorBody error = decodeErrorBody(frame.body);
        throw FocasError(failureLine(call, error.code, error.detail1), error.code, error.detail1);
      }
      if (frame.is(FRAME_UPLOAD_END, DIR_REPLY)) return {};  // the cancel is confirmed
      if (frame.is(FRAME_UPLOAD_END, DIR_REQUEST)) {
        send(FRAME_UPLOAD_END, DIR_REPLY, {});
        return cancelled ? std::string() : text;
      }
      if (!frame.is(FRAME_UPLOAD_DATA, DIR_STREAM) || cancelled) continue;
      text.append(frame.body.begin(), frame.body.end());
      cancelled = text.size() > LONGEST || (progress && !progress(text.size()));
      if (cancelled) send(FRAME_UPLOAD_END, DIR_REQUEST, {});
      if (text.size() > LONGEST) {
        connection.drop();
        throw FocasError(call + ": expected at most " + std::to_string(LONGEST) + " bytes", EW_OVRFLOW);
      }
    }
  } catch (const WireError& e) {
    connection.drop();
    throw ConnectionError("controller at " + connection.where() + ": " + e.what());
  }
}

}  // namespace smartmill::focas
