// The server against plain sockets: requests and replies as documented in the interoperability notes.
#include "smartmill_focas/server.h"

#include <gtest/gtest.h>

#include <random>

#include "server_rig.h"

namespace smartmill::focas {
namespace {

TEST_F(ServerTest, DocumentedBytes) {
  const auto stream = open(1);
  const auto data = open(2);
  expectReply(
      *data, "001e 0001 001c 0001 0001 0018 Z20",
      "0024 0001 0022 0001 0001 0018 000000000000 0012 0002 0020 \"30\" \" M\" \"G001\" \"01.0\" \"03\"");
  expectReply(*data, "001e 0001 001c 0001 0001 0025 Z20",
              "001a 0001 0018 0001 0001 0025 000000000000 0008 00001388 000a 0000");
  expectReply(*data,
              "0026 0001 0024 0001 0001 0016 000001f4 000001f4 00000000 00000000 00000008 0001e240 000a 0003",
              "0012 0001 0010 0001 0001 0016 000000000000 0000");
  EXPECT_DOUBLE_EQ(*controller_.locked(controller_.macros[500]), 123.456);
  expectReply(*data, "001e 0001 001c 0001 0001 0015 000001f4 000001f4 Z12",
              "001a 0001 0018 0001 0001 0015 000000000000 0008 0001e240 000a 0003");
  expectReply(*data, "001e 0001 001c 0001 0001 0015 000001f5 000001f5 Z12",
              "001a 0001 0018 0001 0001 0015 000000000000 0008 00000000 000a ffff");
  expectReply(*data, "001e 0001 001c 0001 0001 0026 00000007 ffffffff Z12",
              "002a 0001 0028 0001 0001 0026 000000000000 0018 00000000 000a 0003 00000001 000a 0003 "
              "ffffee6c 000a 0003");
  expectReply(*data, "001e 0001 001c 0001 0001 0026 00000001 00000002 Z12",
              "001a 0001 0018 0001 0001 0026 000000000000 0008 000008ca 000a 0003");
  expectReply(
      *data,
      "0056 0003 001c 00010001 00a4 00000001 Z16 001c 00010001 0040 00000003 00000001 Z12 001c 00010001 00a4 "
      "00000001 Z16",
      "003e 0003 0012 00010001 00a4 000000000000 0002 0001 0018 00010001 0040 000000000000 0008 00001388 "
      "000a "
      "0000 0012 00010001 00a4 000000000000 0002 0001");
  expectReply(*data, "0056 0003 001c 0001 0001 0019 Z20 001c 0001 0001 00e1 Z20 001c 0001 0001 0098 Z20",
              "0044 0003 001e 0001 0001 0019 000000000000 000e 000a Z12 0012 0001 0001 00e1 000000000000 "
              "0002 0000 0012 "
              "0001 0001 0098 000000000000 0002 0000");
  // Errors: a missing axis and macro, an unknown opcode, another path.
  expectReply(*data, "001e 0001 001c 0001 0001 0026 00000001 00000009 Z12",
              "0012 0001 0010 0001 0001 0026 0004 0000 0000 0000");
  expectReply(*data, "001e 0001 001c 0001 0001 0015 000003e7 000003e7 Z12",
              "0012 0001 0010 0001 0001 0015 0003 0000 0000 0000");
  expectReply(*data, "001e 0001 001c 0001 0001 7777 Z20",
              "0012 0001 0010 0001 0001 7777 0001 0000 0000 0000");
  expectReply(*data, "001e 0001 001c 0001 0002 0019 Z20",
              "0012 0001 0010 0001 0002 0019 000b 0000 0000 0000");
  // Closed in the order of the reference client: stream circuit, data circuit, TCP.
  for (RawSocket* socket : {stream.get(), data.get()}) {
    socket->send(hex("a0a0a0a0 0001 0201 0000"));
    EXPECT_EQ(show(socket->receive(10)), show(hex("a0a0a0a0 0003 0202 0000")));
  }
}

TEST_F(ServerTest, EveryReplyHasItsLayout) {
  const auto data = open(2);
  struct Case {
    SubRequest request;
    std::size_t size;
  };
  const std::vector<Case> cases{
      {SubRequest(OP_STATUS2), 22},
      {SubRequest(OP_ACTUAL_FEED), 8},
      {SubRequest(OP_SPINDLE, 0, -1), 8},
      {SubRequest(OP_SPINDLE, 1, 1), 8},
      {SubRequest(OP_SPINDLE, 2, 1), 8},
      {SubRequest(OP_SPINDLE, 4, -1), 8},
      {SubRequest(OP_SPINDLE, 5, -1), 8},
      {SubRequest(OP_SPINDLE_NAMES, -1), 4},
      {SubRequest(OP_AXIS_NAMES, 0), 12},
      {SubRequest(OP_AXIS_NAMES, -1), 48},
      {SubRequest(OP_SERVO, 1), 24},
      {SubRequest(OP_UNITS, 1), 12},
      {SubRequest(OP_DISPLAY_FLAGS, 0, -1), 12},
      {SubRequest(OP_POSITION, 0, -1), 24},
      {SubRequest(OP_POSITION, 2, -1), 24},
      {SubRequest(OP_POSITION, 3, -1), 24},
      {SubRequest(OP_POSITION, 4, 1), 8},
      {SubRequest(OP_POSITION, 6, 3), 8},
      {SubRequest(OP_POSITION, 8, -1), 24},
      {SubRequest(OP_READ_MACRO, 500, 502), 24},
      {SubRequest(OP_READ_MACRO_DOUBLE, 500, 3), 24},
      {SubRequest(OP_ALARM), 4},
      {SubRequest(OP_ALARM_MESSAGES, -1, 10, 2, 64), 0},
      {SubRequest(OP_PROGRAM_NUMBER), 8},
      {SubRequest(OP_SEQUENCE_NUMBER), 4},
      {SubRequest(OP_BLOCK_COUNT), 4},
      {SubRequest(OP_EXECUTING_PROGRAM), 40},
      {SubRequest(OP_MAIN_PROGRAM), 256},
      {SubRequest(OP_EXECUTING_BLOCK, 256), 19},
      {SubRequest(OP_CNC_ID), 16},
      {SubRequest(OP_OPERATION_MODE), 2},
      {SubRequest(OP_DNC_DIAGNOSIS), 30},
  };
  std::vector<SubRequest> all;
  for (const Case& c : cases) {
    all.push_back(c.request);
  }
  data->send(encodeFrame(FRAME_DATA, DIR_REQUEST, encodeRequests(all), 1));
  FrameReader reader;
  std::optional<Frame> frame;
  for (;;) {
    const Bytes more = data->receive(1);
    ASSERT_FALSE(more.empty());
    reader.append(more.data(), more.size());
    if ((frame = reader.next())) {
      break;
    }
  }
  const std::vector<SubReply> replies = decodeReplies(frame->body);
  ASSERT_EQ(replies.size(), cases.size());
  for (std::size_t i = 0; i < cases.size(); ++i) {
    EXPECT_EQ(replies[i].code, EW_OK) << i;
    EXPECT_EQ(replies[i].data.size(), cases[i].size) << std::hex << cases[i].request.c3;
  }
}

TEST_F(ServerTest, DncSession) {
  const auto stream = open(1);
  // End without start.
  stream->send(hex("a0a0a0a0 0001 1b01 0000"));
  EXPECT_EQ(show(stream->receive(18)), show(hex("a0a0a0a0 0003 1b03 0008 0000 0001 0000 0000")));
  // Wrong mode.
  controller_.change([](TestController& c) { c.state.aut = AUT_MEM; });
  stream->send(hex(dncStartFrame()));
  EXPECT_EQ(show(stream->receive(18)), show(hex("a0a0a0a0 0003 1903 0008 0000 000c 0000 0000")));
  controller_.change([](TestController& c) { c.state.aut = AUT_REMOTE; });
  stream->send(hex(dncStartFrame()));
  EXPECT_EQ(show(stream->receive(10)), show(hex("a0a0a0a0 0003 1902 0000")));
  // A second start, also from another connection.
  stream->send(hex(dncStartFrame()));
  EXPECT_EQ(show(stream->receive(18)), show(hex("a0a0a0a0 0003 1903 0008 0000 ffff 0000 0000")));
  const auto second = open(1);
  second->send(hex(dncStartFrame()));
  EXPECT_EQ(show(second->receive(18)), show(hex("a0a0a0a0 0003 1903 0008 0000 ffff 0000 0000")));
  // Data circuits answer during DNC.
  const auto data = open(2);
  stream->send(dncText("\nG1 X1 F100\n"));
  expectReply(*data, "001e 0001 001c 0001 0001 0025 Z20",
              "001a 0001 0018 0001 0001 0025 000000000000 0008 00001388 000a 0000");
  stream->send(dncText("X2\n%"));
  stream->send(hex("a0a0a0a0 0001 1b01 0000"));
  EXPECT_EQ(show(stream->receive(10)), show(hex("a0a0a0a0 0003 1b02 0000")));
  EXPECT_EQ(controller_.locked(controller_.text), "\nG1 X1 F100\nX2\n%");
  // Cancel: no reply, the session is over.
  stream->send(hex(dncStartFrame()));
  EXPECT_EQ(show(stream->receive(10)), show(hex("a0a0a0a0 0003 1902 0000")));
  stream->send(hex("a0a0a0a0 0001 1c04 0008 0000 8000 0000 0000"));
  EXPECT_TRUE(eventually([&] { return controller_.locked(controller_.cancels) == 1; }));
  EXPECT_EQ(controller_.locked(controller_.cancel_result), DNC_CANCEL);
  // No DNC on a data circuit.
  data->send(hex(dncStartFrame()));
  EXPECT_EQ(show(data->receive(18)), show(hex("a0a0a0a0 0003 1903 0008 0000 0001 0000 0000")));
}

TEST_F(ServerTest, BackPressureLosesNothing) {
  controller_.change([](TestController& c) { c.free_space = 100; });
  const auto stream = open(1);
  stream->send(hex(dncStartFrame()));
  stream->receive(10);
  std::string text;
  for (int i = 0; i < 20000; ++i) {
    text += "N" + std::to_string(i) + " X" + std::to_string(i % 7) + "\n";
  }
  std::thread writer([&] {
    for (std::size_t at = 0; at < text.size(); at += DNC_CHUNK) {
      stream->send(dncText(text.substr(at, DNC_CHUNK)));
    }
    stream->send(hex("a0a0a0a0 0001 1b01 0000"));
  });
  // With a full buffer the client sends at most the size of a socket buffer.
  EXPECT_TRUE(eventually([&] { return controller_.locked(controller_.text).size() == 100; }));
  for (int i = 0; i < 50; ++i) {
    controller_.change([](TestController& c) { c.free_space += 1000; });
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  controller_.change([](TestController& c) { c.free_space = 1 << 30; });
  writer.join();
  EXPECT_EQ(show(stream->receive(10)), show(hex("a0a0a0a0 0003 1b02 0000")));
  EXPECT_EQ(controller_.locked(controller_.text), text);
}

/// With loopback packets of default size the kernel of a client would buffer megabytes.
TEST_F(ServerTest, AClientWithDefaultBuffersIsStoppedSoon) {
  controller_.change([](TestController& c) { c.free_space = 100; });
  const auto stream = open(1);
  stream->send(hex(dncStartFrame()));
  stream->receive(10);
  const Bytes frame = dncText(std::string(DNC_CHUNK - 1, 'X') + "\n");
  std::size_t taken = 0;
  for (int full = 0; full < 100 && taken < 1000000;) {
    const std::size_t sent = stream->sendSome(frame);
    taken += sent;
    full = sent == 0 ? full + 1 : 0;
    std::this_thread::sleep_for(std::chrono::milliseconds(sent == 0 ? 2 : 0));
  }
  EXPECT_LT(taken, 300000u);
}

TEST_F(ServerTest, AbortSendsAnUnsolicitedErrorFrame) {
  const auto stream = open(1);
  controller_.change([](TestController& c) { c.free_space = 10; });
  stream->send(hex(dncStartFrame()));
  stream->receive(10);
  stream->send(dncText(std::string(1000, 'X')));
  EXPECT_TRUE(eventually([&] { return controller_.locked(controller_.text).size() == 10; }));
  controller_.change([](TestController& c) { c.abort_code = EW_RESET; });
  EXPECT_EQ(show(stream->receive(18)), show(hex("a0a0a0a0 0003 1a03 0008 0000 fffe 0000 0000")));
  // Data in transit are discarded, the end returns the code, the next start works.
  stream->send(dncText("X1\n"));
  stream->send(hex("a0a0a0a0 0001 1b01 0000"));
  EXPECT_EQ(show(stream->receive(18)), show(hex("a0a0a0a0 0003 1b03 0008 0000 fffe 0000 0000")));
  EXPECT_EQ(controller_.locked(controller_.text).size(), 10u);
  stream->send(hex(dncStartFrame()));
  EXPECT_EQ(show(stream->receive(10)), show(hex("a0a0a0a0 0003 1902 0000")));
}

TEST_F(ServerTest, LostClientEndsTheSessionEvenWhenBlocked) {
  controller_.change([](TestController& c) { c.free_space = 10; });
  auto stream = open(1);
  stream->send(hex(dncStartFrame()));
  stream->receive(10);
  stream->send(dncText(std::string(500, 'X')));
  EXPECT_TRUE(eventually([&] { return controller_.locked(controller_.text).size() == 10; }));
  stream->close();
  EXPECT_TRUE(eventually([&] { return controller_.locked(controller_.disconnects) == 1; }));
  // A client that has sent the end before disconnecting is served completely.
  stream = open(1);
  stream->send(hex(dncStartFrame()));
  stream->receive(10);
  stream->send(dncText(std::string(500, 'Y')));
  stream->send(hex("a0a0a0a0 0001 1b01 0000"));
  stream->shutdownSend();
  std::this_thread::sleep_for(std::chrono::milliseconds(30));
  EXPECT_EQ(controller_.locked(controller_.disconnects), 1);
  controller_.change([](TestController& c) { c.free_space = 1 << 20; });
  EXPECT_EQ(show(stream->receive(10)), show(hex("a0a0a0a0 0003 1b02 0000")));
  EXPECT_EQ(controller_.locked(controller_.ends), 1);
}

TEST_F(ServerTest, SixthSessionIsRefused) {
  std::vector<std::unique_ptr<RawSocket>> sessions;
  for (int i = 0; i < 5; ++i) {
    sessions.push_back(open(1));
    sessions.push_back(open(2));
  }
  RawSocket sixth(RawSocket::connectTo(server_.port()));
  sixth.send(hex("a0a0a0a0 0001 0101 0002 0001"));
  EXPECT_EQ(show(sixth.receive(18)), show(hex("a0a0a0a0 0003 0103 0008 0000 0002 0000 0000")));
  EXPECT_TRUE(sixth.closedByPeer());
  sessions.clear();
  EXPECT_TRUE(eventually([&] { return server_.connections() == 0; }));
  open(1);
}

TEST_F(ServerTest, DataBeforeOpenIsRefused) {
  RawSocket socket(RawSocket::connectTo(server_.port()));
  socket.send(hex("a0a0a0a0 0001 2101 001e 0001 001c 0001 0001 0018 Z20"));
  EXPECT_EQ(show(socket.receive(18)), show(hex("a0a0a0a0 0003 2103 0008 0000 fff8 0000 0000")));
}

TEST_F(ServerTest, MalformedPduIsAnErrorFrameAndTheConnectionRemains) {
  const auto data = open(2);
  data->send(hex("a0a0a0a0 0001 2101 0004 0001 ffff"));
  EXPECT_EQ(show(data->receive(18)), show(hex("a0a0a0a0 0003 2103 0008 0000 0002 0000 0000")));
  expectReply(*data, "001e 0001 001c 0001 0001 0025 Z20",
              "001a 0001 0018 0001 0001 0025 000000000000 0008 00001388 000a 0000");
  // A write without value.
  expectReply(*data, "001e 0001 001c 0001 0001 0016 000001f4 000001f4 Z12",
              "0012 0001 0010 0001 0001 0016 0002 0000 0000 0000");
}

TEST_F(ServerTest, GarbageClosesOnlyItsOwnConnection) {
  const auto data = open(2);
  std::mt19937 random(3);
  for (int i = 0; i < 30; ++i) {
    RawSocket socket(RawSocket::connectTo(server_.port()));
    Bytes garbage(1 + random() % 300);
    for (std::uint8_t& byte : garbage) {
      byte = static_cast<std::uint8_t>(random());
    }
    if (i % 3 == 0) {
      // A valid open, then a frame with random type, direction and body.
      socket.send(hex("a0a0a0a0 0001 0101 0002 0002"));
      garbage = encodeFrame(garbage[0], static_cast<std::uint8_t>(random() % 5), garbage, 1);
    }
    socket.send(garbage);
  }
  RawSocket web(RawSocket::connectTo(server_.port()));
  const std::string get = "GET / HTTP/1.0\r\n\r\n";
  web.send(Bytes(get.begin(), get.end()));
  EXPECT_TRUE(web.closedByPeer());
  expectReply(*data, "001e 0001 001c 0001 0001 0025 Z20",
              "001a 0001 0018 0001 0001 0025 000000000000 0008 00001388 000a 0000");
}

TEST_F(ServerTest, ARequestInSingleBytesIsAssembled) {
  const auto data = open(2);
  for (std::uint8_t byte : hex("a0a0a0a0 0001 2101 001e 0001 001c 0001 0001 0025 Z20")) {
    data->send({byte});
  }
  EXPECT_EQ(
      show(data->receive(36)),
      show(hex("a0a0a0a0 0003 2102 001a 0001 0018 0001 0001 0025 000000000000 0008 00001388 000a 0000")));
}

TEST(Server, TakenPortIsOneLine) {
  TestController controller;
  ServerOptions options;
  options.port = 0;
  Server first(options, controller.calls());
  options.port = first.port();
  try {
    Server second(options, controller.calls());
    FAIL();
  } catch (const std::runtime_error& e) {
    EXPECT_NE(std::string(e.what()).find("cannot listen on 127.0.0.1:" + std::to_string(first.port())),
              std::string::npos);
  }
  first.stop();
  first.stop();
}

}  // namespace
}  // namespace smartmill::focas
