#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "smartmill_focas/server.h"
#include "test_controller.h"
#include "test_wire.h"

namespace smartmill::focas {

/// A server with a TestController in DNC mode, and plain sockets to it.
class ServerTest : public ::testing::Test {
 protected:
  ServerTest() : server_(options(), controller_.calls()) {
    controller_.change([](TestController& c) { c.state.aut = AUT_REMOTE; });
  }
  static ServerOptions options() {
    ServerOptions o;
    o.port = 0;
    return o;
  }
  std::unique_ptr<RawSocket> open(int circuit) {
    auto socket = std::make_unique<RawSocket>(RawSocket::connectTo(server_.port()));
    socket->send(hex("a0a0a0a0 0001 0101 0002 000" + std::to_string(circuit)));
    const Bytes reply = socket->receive(82);
    EXPECT_EQ(show(Bytes(reply.begin(), reply.begin() + 10)), show(hex("a0a0a0a0 0003 0102 0048")));
    return socket;
  }
  /// Sends one data PDU and checks the body of the reply.
  void expectReply(RawSocket& socket, const std::string& request, const std::string& expected) {
    const Bytes out = hex("a0a0a0a0 0001 2101" + request);
    socket.send(out);
    const Bytes reply = hex("a0a0a0a0 0003 2102" + expected);
    EXPECT_EQ(show(socket.receive(reply.size())), show(reply)) << request;
  }
  static std::string dncStartFrame() { return "a0a0a0a0 0001 1901 0204 00000001 Z512"; }
  static Bytes dncText(const std::string& text) {
    return encodeFrame(FRAME_DNC_DATA, DIR_STREAM, Bytes(text.begin(), text.end()), 1);
  }
  /// The next frame of a socket: header, then body.
  static Frame nextFrame(RawSocket& socket) {
    FrameReader reader;
    Bytes bytes = socket.receive(HEADER_SIZE);
    reader.append(bytes.data(), bytes.size());
    if (bytes.size() < HEADER_SIZE) {
      return {};
    }
    const std::size_t size = static_cast<std::size_t>(bytes[8]) << 8 | bytes[9];
    bytes = socket.receive(size);
    reader.append(bytes.data(), bytes.size());
    return reader.next().value_or(Frame{});
  }

  TestController controller_;
  Server server_;
};

}  // namespace smartmill::focas
