// The client against plain sockets (documented bytes, faulty servers) and against the server.
#include "smartmill_focas/client.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <mutex>

#include "test_controller.h"
#include "test_wire.h"

namespace smartmill::focas {
namespace {

constexpr double TIMEOUT = 60.0;  // [s] long, so that the tests do not depend on the speed of the computer

const char* const OPEN_REPLY_BODY = "00000000 00000003 0001 0001 Z8 0001 Z6 0001 Z10 0001 Z30";
const char* const SYSINFO_REPLY =
    "a0a0a0a0 0003 2102 0024 0001 0022 0001 0001 0018 000000000000 0012 0002 0020 \"30\" \" M\" \"G001\" "
    "\"01.0\" "
    "\"03\"";

/// Answers requests with given bytes, optionally byte by byte, and records the requests.
class ScriptedServer {
 public:
  using Answers = std::map<std::string, std::string>;
  explicit ScriptedServer(Answers answers, bool piecewise = false)
      : answers_(std::move(answers)), piecewise_(piecewise) {
    for (const char* code : {"1", "2"}) {
      answers_.emplace(std::string("a0a0a0a0 0001 0101 0002 000") + code,
                       std::string("a0a0a0a0 0003 0102 0048 ") + OPEN_REPLY_BODY);
    }
    answers_.emplace("a0a0a0a0 0001 2101 001e 0001 001c 0001 0001 0018 Z20", SYSINFO_REPLY);
    answers_.emplace("a0a0a0a0 0001 0201 0000", "a0a0a0a0 0003 0202 0000");
    for (const auto& [request, reply] : answers_) {
      table_[show(hex(request))] = hex(reply);
    }
    thread_ = std::thread([this] { run(); });
  }
  ~ScriptedServer() {
    done_ = true;
    thread_.join();
  }
  std::uint16_t port() const { return listener_.port(); }
  std::vector<std::string> requests() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return requests_;
  }

 private:
  void run() {
    RawSocket stream(listener_.accept());
    FrameReader readers[2];
    serveOne(stream, readers[0]);
    RawSocket data(listener_.accept());
    while (!done_) {
      serveWaiting(stream, readers[0]);
      serveWaiting(data, readers[1]);
    }
  }
  void serveWaiting(RawSocket& socket, FrameReader& reader) {
    const Bytes more = socket.receiveSome(1);
    reader.append(more.data(), more.size());
    while (answer(socket, reader)) {
    }
  }
  void serveOne(RawSocket& socket, FrameReader& reader) {
    do {
      const Bytes more = socket.receive(1);
      reader.append(more.data(), more.size());
    } while (!answer(socket, reader));
  }
  bool answer(RawSocket& socket, FrameReader& reader) {
    const std::optional<Frame> frame = reader.next();
    if (!frame) {
      return false;
    }
    const std::string request = show(encodeFrame(frame->type, frame->direction, frame->body, frame->version));
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      requests_.push_back(request);
    }
    const auto found = table_.find(request);
    if (found != table_.end() && piecewise_) {
      for (std::uint8_t byte : found->second) {
        socket.send({byte});
      }
    } else if (found != table_.end()) {
      socket.send(found->second);
    }
    return true;
  }

  RawListener listener_;
  std::map<std::string, std::string> answers_;
  std::map<std::string, Bytes> table_;
  bool piecewise_;
  std::atomic<bool> done_{false};
  std::mutex mutex_;
  std::vector<std::string> requests_;
  std::thread thread_;
};

TEST(ClientBytes, DocumentedRequestsAndReplies) {
  for (const bool piecewise : {false, true}) {
    ScriptedServer server(
        {{"a0a0a0a0 0001 2101 0056 0003 001c 0001 0001 0019 Z20 001c 0001 0001 00e1 Z20 001c 0001 0001 0098 "
          "Z20",
          // hdck refused, the other replies are used
          "a0a0a0a0 0003 2102 0042 0003 001e 0001 0001 0019 000000000000 000e 000a 0003 0001 0000 0000 0001 "
          "0000 0010 "
          "0001 0001 00e1 0001 0000 0000 0000 0012 0001 0001 0098 000000000000 0002 0001"},
         {"a0a0a0a0 0001 2101 001e 0001 001c 0001 0001 0025 Z20",
          "a0a0a0a0 0003 2102 001a 0001 0018 0001 0001 0025 000000000000 0008 00001388 000a 0000"},
         {"a0a0a0a0 0001 2101 0056 0003 001c 00010001 00a4 00000001 Z16 001c 00010001 0040 00000003 00000001 "
          "Z12 001c "
          "00010001 00a4 00000001 Z16",
          "a0a0a0a0 0003 2102 003e 0003 0012 00010001 00a4 000000000000 0002 0001 0018 00010001 0040 "
          "000000000000 0008 "
          "00000bb8 000a 0000 0012 00010001 00a4 000000000000 0002 0001"},
         {"a0a0a0a0 0001 2101 001e 0001 001c 0001 0001 0026 00000007 ffffffff Z12",
          // more slots than axes: the surplus is invalid
          "a0a0a0a0 0003 2102 0032 0001 0030 0001 0001 0026 000000000000 0020 00000064 000a 0003 ffffff9c "
          "000a 0002 "
          "00000003 000a 0000 deadbeef dead beef"},
         {"a0a0a0a0 0001 2101 001e 0001 001c 0001 0001 0015 000001f4 000001f4 Z12",
          "a0a0a0a0 0003 2102 001a 0001 0018 0001 0001 0015 000000000000 0008 0001e240 000a 0003"},
         {"a0a0a0a0 0001 2101 0026 0001 0024 0001 0001 0016 000001f4 000001f4 00000000 00000000 00000008 "
          "0001e240 000a "
          "0003",
          "a0a0a0a0 0003 2102 0012 0001 0010 0001 0001 0016 000000000000 0000"},
         {"a0a0a0a0 0001 1901 0204 00000001 Z512", "a0a0a0a0 0003 1902 0000"},
         {"a0a0a0a0 0001 1b01 0000", "a0a0a0a0 0003 1b02 0000"}},
        piecewise);
    Client client;
    client.connect("127.0.0.1", server.port(), TIMEOUT);
    EXPECT_EQ(client.info().axes, 3);
    EXPECT_EQ(client.info().spindles, 1);
    EXPECT_EQ(client.info().cnc_type, "30");
    EXPECT_EQ(client.info().series, "G001");
    EXPECT_TRUE(client.info().spindle_meter);
    const Status status = client.statusInfo();
    EXPECT_EQ(status.aut, AUT_REMOTE);
    EXPECT_EQ(status.run, RUN_START);
    EXPECT_EQ(status.motion, MOTION_MOVES);
    EXPECT_EQ(status.alarm, 1);
    EXPECT_EQ(status.hdck, 0);
    EXPECT_EQ(status.tmmode, 1);
    EXPECT_EQ(client.actualSpeed(), 5000.0);
    EXPECT_EQ(client.actualSpeeds(1), std::vector<double>{3000.0});
    EXPECT_EQ(client.position(POSITION_DISTANCE), (std::vector<double>{0.1, -1.0, 3.0}));
    EXPECT_EQ(client.readMacro(500), 123.456);
    client.writeMacro(500, 123.456);
    client.dncStart();
    const std::string text(5000, 'G');
    EXPECT_EQ(client.dncSend(text.data(), text.size()), 5000u);
    client.dncEnd();
    client.dncStart();
    client.dncCancel();
    client.close();
    EXPECT_FALSE(client.connected());
    // Frames of the stream: three full ones and the remainder, without acknowledgement; the cancel with its
    // result.
    std::vector<std::string> stream;
    for (const std::string& request : server.requests()) {
      if (request.substr(12, 4) == "1a04" || request.substr(12, 4) == "1c04" ||
          request.substr(12, 2) == "02") {
        stream.push_back(request);
      }
    }
    ASSERT_EQ(stream.size(), 7u);
    for (std::size_t i = 0; i < 4; ++i) {
      EXPECT_EQ(stream[i].substr(12, 8), i < 3 ? "1a0405aa" : "1a04028a");
    }
    EXPECT_EQ(stream[4], show(hex("a0a0a0a0 0001 1c04 0008 0000 8000 0000 0000")));
    EXPECT_EQ(stream[5], show(hex("a0a0a0a0 0001 0201 0000")));
    EXPECT_EQ(stream[6], stream[5]);
  }
}

TEST(ClientBytes, UploadAsDocumented) {
  for (const bool piecewise : {false, true}) {
    ScriptedServer server({{"a0a0a0a0 0001 1501 0204 00000001 \"O0012-O0012\" Z501",
                            "a0a0a0a0 0003 1502 0000 a0a0a0a0 0003 1604 0007 25 0a \"O0012\" a0a0a0a0 0003 "
                            "1604 0006 0a \"M30\" 0a "
                            "25 a0a0a0a0 0003 1701 0000"},
                           {"a0a0a0a0 0001 1501 0204 00000001 \"O0013-O0013\" Z501",
                            "a0a0a0a0 0003 1503 0008 0000 0005 0000 0000"}},
                          piecewise);
    Client client;
    client.connect("127.0.0.1", server.port(), TIMEOUT);
    EXPECT_EQ(client.upload(12), "%\nO0012\nM30\n%");
    try {
      client.upload(13);
      ADD_FAILURE();
    } catch (const FocasError& e) {
      EXPECT_STREQ(e.what(), "upload of O13: EW_DATA (5), detail 0");
    }
    EXPECT_EQ(client.upload(12), "%\nO0012\nM30\n%");
    // The end is confirmed.
    const std::string confirmed = show(hex("a0a0a0a0 0001 1702 0000"));
    EXPECT_TRUE(eventually([&] {
      const std::vector<std::string> requests = server.requests();
      return std::count(requests.begin(), requests.end(), confirmed) == 2;
    }));
  }
}

TEST(ClientBytes, LegacyReplyVersionIsAccepted) {
  ScriptedServer server(ScriptedServer::Answers{
      {"a0a0a0a0 0001 2101 001e 0001 001c 0001 0001 0025 Z20",
       "a0a0a0a0 0001 2102 001a 0001 0018 0001 0001 0025 000000000000 0008 00000007 000a 0000"}});
  Client client;
  client.connect("127.0.0.1", server.port(), TIMEOUT);
  EXPECT_EQ(client.actualSpeed(), 7.0);
}

TEST(ClientBytes, WholePduFailureAndShortReplies) {
  ScriptedServer server(
      {{"a0a0a0a0 0001 2101 001e 0001 001c 0001 0001 0025 Z20",
        "a0a0a0a0 0003 2103 0008 0000 ffff 0007 0000"},
       {"a0a0a0a0 0001 2101 001e 0001 001c 0001 0001 0024 Z20",
        "a0a0a0a0 0003 2102 0014 0001 0012 0001 0001 0024 000000000000 0002 0001"},
       {"a0a0a0a0 0001 2101 001e 0001 001c 0001 0001 001d Z20",
        "a0a0a0a0 0003 2102 0012 0001 0010 0001 0001 001d 0006 0003 0000 0000"},
       {"a0a0a0a0 0001 2101 001e 0001 001c 0001 0001 001a Z20", "a0a0a0a0 0003 2102 0004 0001 ffff"}});
  Client client;
  client.connect("127.0.0.1", server.port(), TIMEOUT);
  try {
    client.actualSpeed();
    FAIL();
  } catch (const FocasError& e) {
    EXPECT_EQ(e.code(), EW_BUSY);
    EXPECT_EQ(e.detail(), 7);
  }
  try {
    client.actualFeed();
    FAIL();
  } catch (const FocasError& e) {
    EXPECT_EQ(e.code(), EW_LENGTH);
  }
  try {
    client.sequenceNumber();
    FAIL();
  } catch (const FocasError& e) {
    EXPECT_STREQ(e.what(), "cnc_rdseqnum: EW_NOOPT (6), detail 3");
  }
  EXPECT_TRUE(client.connected());
  // A body with a wrong length makes the connection unusable.
  EXPECT_THROW(client.alarmBits(), ConnectionError);
  EXPECT_FALSE(client.connected());
  EXPECT_THROW(client.alarmBits(), ConnectionError);
}

TEST(ClientBytes, SilentServerIsATimeout) {
  RawListener listener;
  std::thread peer([&] {
    RawSocket socket(listener.accept());
    socket.closedByPeer();  // reads without an answer
    socket.closedByPeer();
    socket.receive(1000, 2000);
  });
  Client client;
  try {
    client.connect("127.0.0.1", listener.port(), 0.1);
    ADD_FAILURE();
  } catch (const ConnectionError& e) {
    EXPECT_NE(std::string(e.what()).find("no answer in time"), std::string::npos) << e.what();
  }
  peer.join();
}

TEST(ClientBytes, ClosedPortIsOneLine) {
  std::uint16_t port = 0;
  {
    RawListener listener;
    port = listener.port();
  }
  Client client;
  try {
    client.connect("127.0.0.1", port, TIMEOUT);
    FAIL();
  } catch (const ConnectionError& e) {
    EXPECT_EQ(std::string(e.what()), "cannot connect to the controller at 127.0.0.1:" + std::to_string(port) +
                                         ": Connection refused");
  }
}

TEST(ClientBytes, AnotherProtocolOnThePort) {
  RawListener listener;
  std::thread peer([&] {
    RawSocket socket(listener.accept());
    const std::string text = "SSH-2.0-OpenSSH\r\n";
    socket.send(Bytes(text.begin(), text.end()));
    socket.receive(1000);
  });
  Client client;
  EXPECT_THROW(client.connect("127.0.0.1", listener.port(), TIMEOUT), ConnectionError);
  peer.join();
}

class ClientServerTest : public ::testing::Test {
 protected:
  ClientServerTest() {
    controller_.state.aut = AUT_REMOTE;
    ServerOptions options;
    options.port = 0;
    server_ = std::make_unique<Server>(options, controller_.calls());
    client_.connect("127.0.0.1", server_->port(), TIMEOUT);
  }
  TestController controller_;
  std::unique_ptr<Server> server_;
  Client client_;
};

TEST_F(ClientServerTest, EveryTypedCall) {
  controller_.change([](TestController& c) {
    c.state.run = RUN_START;
    c.state.emergency = 1;
    c.state.tmmode = 1;
    c.alarm_bits = 0x10;
    c.alarms = {{100, 1, 0, "PARAMETER ENABLE"}, {500, 4, 2, std::string(100, 'x')}};
  });
  const Status status = client_.statusInfo();
  EXPECT_EQ(status.run, RUN_START);
  EXPECT_EQ(status.emergency, 1);
  EXPECT_EQ(status.tmmode, 1);
  EXPECT_EQ(client_.position(POSITION_MACHINE), controller_.machine);
  EXPECT_EQ(client_.position(POSITION_ABSOLUTE), controller_.absolute);
  EXPECT_EQ(client_.position(POSITION_RELATIVE), controller_.relative);
  EXPECT_EQ(client_.position(POSITION_DISTANCE), controller_.distance);
  EXPECT_EQ(client_.position(POSITION_MACHINE, 3), std::vector<double>{300.125});
  EXPECT_THROW(client_.position(POSITION_MACHINE, 4), FocasError);
  EXPECT_EQ(client_.actualFeed(), 1234.0);
  EXPECT_EQ(client_.actualSpeed(), 5000.0);
  EXPECT_EQ(client_.actualSpeeds(), std::vector<double>{5000.0});
  EXPECT_EQ(client_.spindleLoad(), std::vector<double>{12.0});  // integer percent
  const LoadMeter meter = client_.spindleMeter();
  EXPECT_EQ(meter.names, std::vector<std::string>{"S1"});
  EXPECT_EQ(meter.load, std::vector<double>{12.34});
  EXPECT_EQ(meter.speed, std::vector<double>{5000.0});
  const LoadMeter servo = client_.servoMeter();
  EXPECT_EQ(servo.names, (std::vector<std::string>{"X", "Y", "Z"}));
  EXPECT_EQ(servo.load, (std::vector<double>{5.5, 6.25, 7.75}));
  EXPECT_EQ(client_.diagnosis(308, -1), (std::vector<double>{28.0, 28.0, 44.0}));
  EXPECT_EQ(client_.diagnosis(308, 3), std::vector<double>{44.0});
  EXPECT_THROW(client_.diagnosis(403, 1), FocasError);  // this controller has no such number
  EXPECT_EQ(client_.axisNames(), servo.names);
  EXPECT_EQ(client_.readMacro(500), 2.5);
  EXPECT_EQ(client_.readMacro(501), std::nullopt);
  client_.writeMacro(501, -0.125);
  EXPECT_EQ(client_.readMacro(501), -0.125);
  client_.writeMacro(501, std::nullopt);
  EXPECT_EQ(client_.readMacro(501), std::nullopt);
  EXPECT_THROW(client_.readMacro(999), FocasError);
  client_.writeMacros(500, {1.0 / 3.0, 2e20});
  const std::vector<double> macros = client_.readMacros(500, 3);
  EXPECT_EQ(macros, (std::vector<double>{1.0 / 3.0, 2e20, -7.0}));
  EXPECT_EQ(client_.alarmBits(), 0x10u);
  const std::vector<AlarmMessage> alarms = client_.alarmMessages();
  ASSERT_EQ(alarms.size(), 2u);
  EXPECT_EQ(alarms[0].number, 100);
  EXPECT_EQ(alarms[0].text, "PARAMETER ENABLE");
  EXPECT_EQ(alarms[1].axis, 2);
  EXPECT_EQ(alarms[1].text, std::string(64, 'x'));
  int running = 0, main_program = 0;
  client_.programNumber(&running, &main_program);
  EXPECT_EQ(running, 1234);
  EXPECT_EQ(main_program, 4321);
  EXPECT_EQ(client_.sequenceNumber(), 77);
  EXPECT_EQ(client_.executingBlock(), "N77 G1 X10 F600");
  EXPECT_THROW(client_.reset(), FocasError);
  EXPECT_THROW(client_.cycleStart(), FocasError);
}

TEST_F(ClientServerTest, SeveralRequestsInOnePdu) {
  const std::vector<SubReply> replies = client_.exchange(
      {SubRequest(OP_STATUS), SubRequest(0x7777), SubRequest(OP_POSITION, POSITION_MACHINE, -1)});
  ASSERT_EQ(replies.size(), 3u);
  EXPECT_EQ(replies[1].code, EW_FUNC);
  EXPECT_EQ(decodeValues(replies[2], 2), (std::vector<double>{-1.5, 2.25}));
}

TEST_F(ClientServerTest, DncWithBackPressureLosesNothing) {
  controller_.change([](TestController& c) { c.free_space = 0; });
  client_.dncStart();
  EXPECT_TRUE(client_.dncOpen());
  std::string text;
  for (int i = 0; i < 40000; ++i) {
    text += "N" + std::to_string(i) + " X" + std::to_string(i % 11) + "\n";
  }
  // A machine that accepts no text stops the client long before the end of the program.
  std::size_t sent = 0;
  ASSERT_TRUE(eventually([&] {
    const std::size_t taken = client_.dncSend(text.data() + sent, text.size() - sent);
    sent += taken;
    return taken == 0;
  }));
  EXPECT_LT(sent, 65536u);
  EXPECT_EQ(controller_.locked(controller_.text).size(), 0u);
  // The data circuit still works.
  EXPECT_EQ(client_.actualSpeed(), 5000.0);
  controller_.change([](TestController& c) { c.free_space = 1 << 30; });
  ASSERT_TRUE(eventually([&] {
    sent += client_.dncSend(text.data() + sent, text.size() - sent);
    return sent == text.size();
  }));
  client_.dncEnd();
  EXPECT_FALSE(client_.dncOpen());
  EXPECT_EQ(controller_.locked(controller_.text), text);
  EXPECT_EQ(controller_.locked(controller_.ends), 1);
}

TEST_F(ClientServerTest, UploadCanBeCancelled) {
  const std::string text = "%\nO1234\n" + std::string(3000, 'X') + "\n%\n";
  std::size_t size = 0;
  EXPECT_EQ(client_.upload(1234,
                           [&](std::size_t so_far) {
                             size = so_far;
                             return true;
                           }),
            text);
  EXPECT_EQ(size, text.size());
  EXPECT_EQ(client_.upload(1234, [](std::size_t) { return false; }), "");
  EXPECT_EQ(client_.upload(1234), text);
  EXPECT_THROW(client_.upload(0), FocasError);
  client_.dncStart();
  try {
    client_.upload(1234);
    ADD_FAILURE();
  } catch (const FocasError& e) {
    EXPECT_EQ(e.code(), EW_BUSY);
  }
  EXPECT_TRUE(client_.dncOpen());
}

TEST_F(ClientServerTest, StartRefusals) {
  for (EwCode code : {EW_MODE, EW_REJECT, EW_ALARM, EW_BUSY}) {
    controller_.change([&](TestController& c) { c.refuse_start = code; });
    try {
      client_.dncStart();
      FAIL();
    } catch (const FocasError& e) {
      EXPECT_EQ(e.code(), code);
    }
    EXPECT_FALSE(client_.dncOpen());
  }
  EXPECT_THROW(client_.dncSend("X", 1), FocasError);
}

TEST_F(ClientServerTest, AbortReachesTheSender) {
  controller_.change([](TestController& c) { c.free_space = 100; });
  client_.dncStart();
  const std::string text(20000, 'X');
  client_.dncSend(text.data(), text.size());
  controller_.change([](TestController& c) { c.abort_code = EW_RESET; });
  int code = EW_OK;
  ASSERT_TRUE(eventually([&] {
    try {
      client_.dncSend(text.data(), 1);
    } catch (const FocasError& e) {
      code = e.code();
    }
    return code != EW_OK;
  }));
  EXPECT_EQ(code, EW_RESET);
  // Even if a frame was partly sent, the next session starts without its remainder.
  controller_.change([](TestController& c) {
    c.abort_code = EW_OK;
    c.text.clear();
    c.free_space = 1 << 20;
  });
  client_.dncStart();
  client_.dncSend("X1\n", 3);
  client_.dncEnd();
  EXPECT_EQ(controller_.locked(controller_.text), "X1\n");
}

TEST_F(ClientServerTest, AbortAnswersTheEnd) {
  client_.dncStart();
  controller_.change([](TestController& c) { c.abort_code = EW_ALARM; });
  ASSERT_TRUE(eventually([&] { return !controller_.locked(controller_.session); }));
  try {
    client_.dncEnd();
    FAIL();
  } catch (const FocasError& e) {
    EXPECT_EQ(e.code(), EW_ALARM);
  }
  // The reply to the end, received after the abort, must not disturb the next session.
  controller_.change([](TestController& c) { c.abort_code = EW_OK; });
  client_.dncStart();
  client_.dncSend("X2\n", 3);
  client_.dncEnd();
  EXPECT_EQ(controller_.locked(controller_.text), "X2\n");
}

TEST_F(ClientServerTest, CancelTakesEffectWhenTheStreamIsFull) {
  client_.dncStart();
  client_.dncCancel();
  ASSERT_TRUE(eventually([&] { return controller_.locked(controller_.cancels) == 1; }));
  controller_.change([](TestController& c) { c.free_space = 0; });
  client_.dncStart();
  const std::string text(100000, 'X');
  std::size_t sent = 0;
  while (const std::size_t taken = client_.dncSend(text.data() + sent, text.size() - sent)) {
    sent += taken;
  }
  client_.dncCancel();
  EXPECT_TRUE(eventually([&] { return controller_.locked(controller_.disconnects) == 1; }));
  EXPECT_TRUE(client_.connected());
  client_.dncStart();
  EXPECT_TRUE(client_.dncOpen());
}

TEST_F(ClientServerTest, AStoppedServerIsALostConnection) {
  client_.dncStart();
  server_->stop();
  EXPECT_EQ(controller_.locked(controller_.disconnects), 1);
  EXPECT_THROW(client_.actualSpeed(), ConnectionError);
  EXPECT_FALSE(client_.connected());
  EXPECT_THROW(client_.dncSend("X", 1), ConnectionError);
  EXPECT_THROW(client_.connect("127.0.0.1", server_->port(), TIMEOUT), ConnectionError);
}

TEST_F(ClientServerTest, AStoppedServerIsDetectedInADncSession) {
  client_.dncStart();
  server_->stop();
  EXPECT_THROW(client_.dncCheck(), ConnectionError);
}

TEST_F(ClientServerTest, SixthClientIsRefused) {
  std::vector<std::unique_ptr<Client>> others;
  for (int i = 0; i < 4; ++i) {
    others.push_back(std::make_unique<Client>());
    others.back()->connect("127.0.0.1", server_->port(), TIMEOUT);
  }
  Client sixth;
  try {
    sixth.connect("127.0.0.1", server_->port(), TIMEOUT);
    FAIL();
  } catch (const FocasError& e) {
    EXPECT_EQ(e.code(), 2);
  }
  others.front()->close();
  ASSERT_TRUE(eventually([&] {
    try {
      sixth.connect("127.0.0.1", server_->port(), TIMEOUT);
      return true;
    } catch (const FocasError&) {
      return false;
    }
  }));
  EXPECT_EQ(sixth.actualSpeed(), 5000.0);
}

}  // namespace
}  // namespace smartmill::focas
