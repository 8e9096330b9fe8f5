// Recording of a session by the tap, and replay of recorded sessions to the client and the server.
#include "smartmill_focas/recording.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>

#include "server_rig.h"

namespace smartmill::focas {
namespace {

constexpr double TIMEOUT = 60.0;                                    // [s]
const char* const SIMULATED = "test/sessions/simulated_30i.focas";  // relative to the package

Bytes wire(const Frame& f) {
  return encodeFrame(f.type, f.direction, f.body, f.version);
}

/// A controller that replays the replies of a recording and checks the requests.
class ReplayController {
 public:
  explicit ReplayController(const std::vector<RecordedFrame>& frames) {
    for (const RecordedFrame& frame : frames) {
      connections_[frame.connection].push_back(frame);
    }
    thread_ = std::thread([this] { run(); });
  }
  ~ReplayController() { thread_.join(); }
  std::uint16_t port() const { return listener_.port(); }
  int answered() const { return answered_; }
  std::string fault() const { return fault_; }

 private:
  void run() {
    std::vector<std::thread> threads;
    for (const auto& [number, frames] : connections_) {
      auto socket = std::make_shared<RawSocket>(listener_.accept());
      threads.emplace_back([this, socket, &frames = frames] { play(*socket, frames); });
    }
    for (std::thread& thread : threads) {
      thread.join();
    }
  }
  void play(RawSocket& socket, const std::vector<RecordedFrame>& frames) {
    for (const RecordedFrame& frame : frames) {
      const Bytes expected = wire(frame.frame);
      if (!frame.from_client) {
        socket.send(expected);
        ++answered_;
        continue;
      }
      const Bytes received = socket.receive(expected.size());
      if (received != expected) {
        const std::lock_guard<std::mutex> lock(mutex_);
        fault_ += "request " + show(received) + "\nexpected " + show(expected) + "\n";
        return;
      }
    }
  }

  RawListener listener_;
  std::map<int, std::vector<RecordedFrame>> connections_;
  std::atomic<int> answered_{0};
  std::mutex mutex_;
  std::string fault_;
  std::thread thread_;
};

TEST_F(ServerTest, TapForwardsEveryByteAndReportsEveryFrame) {
  const std::string file = (std::filesystem::temp_directory_path() / "smartmill_tap_test.focas").string();
  std::size_t reported = 0;
  {
    std::ofstream out(file);
    beginRecording(out);
    std::mutex mutex;
    Tap tap(0, "127.0.0.1", server_.port(), TIMEOUT, [&](const RecordedFrame& frame) {
      const std::lock_guard<std::mutex> lock(mutex);
      append(out, frame);
      ++reported;
    });
    Client client;
    client.connect("127.0.0.1", tap.port(), TIMEOUT);
    askEverything(client);
    client.dncStart();
    client.dncSend("\nG1 X1\n%", 8);
    client.dncEnd(TIMEOUT);
    client.close();
  }
  EXPECT_EQ(controller_.locked(controller_.text), "\nG1 X1\n%");
  const std::vector<RecordedFrame> frames = readRecording(file);
  EXPECT_EQ(frames.size(), reported);
  // Every request except the DNC text has a reply.
  const auto requests =
      std::count_if(frames.begin(), frames.end(), [](const auto& f) { return f.from_client; });
  EXPECT_EQ(2 * requests - 1, static_cast<long>(frames.size()));
  std::remove(file.c_str());
}

TEST(Recording, ClientRepeatsTheRecordedSession) {
  const std::vector<RecordedFrame> frames = readRecording(SIMULATED);
  ReplayController controller(frames);
  {
    Client client;
    client.connect("127.0.0.1", controller.port(), TIMEOUT);
    EXPECT_EQ(client.info().cnc_type, "30");
    EXPECT_EQ(client.info().axes, 3);
    askEverything(client);
    client.close();
  }
  EXPECT_TRUE(eventually([&] { return 2 * controller.answered() == static_cast<int>(frames.size()); }));
  EXPECT_EQ(controller.fault(), "");
}

/// The replies of the server to recorded requests have the same type, direction, version and calls, and the
/// same length except for data.
TEST_F(ServerTest, ServerAnswersTheRecordedRequestsInTheSameLayout) {
  std::map<int, std::unique_ptr<RawSocket>> sockets;
  for (const RecordedFrame& recorded : readRecording(SIMULATED)) {
    auto& socket = sockets[recorded.connection];
    if (!socket) {
      socket = std::make_unique<RawSocket>(RawSocket::connectTo(server_.port()));
    }
    if (recorded.from_client) {
      socket->send(wire(recorded.frame));
      continue;
    }
    const Frame reply = nextFrame(*socket);
    EXPECT_EQ(reply.type, recorded.frame.type);
    EXPECT_EQ(reply.direction, recorded.frame.direction);
    EXPECT_EQ(reply.version, recorded.frame.version);
    if (reply.type != FRAME_DATA) {
      EXPECT_EQ(reply.body.size(), recorded.frame.body.size());
      continue;
    }
    const std::vector<SubReply> expected = decodeReplies(recorded.frame.body),
                                actual = decodeReplies(reply.body);
    ASSERT_EQ(actual.size(), expected.size());
    for (std::size_t i = 0; i < actual.size(); ++i) {
      EXPECT_EQ(actual[i].c3, expected[i].c3);
    }
  }
}

TEST(Recording, InvalidFilesAreRefusedWithTheLine) {
  const std::string file = (std::filesystem::temp_directory_path() / "smartmill_no_recording.focas").string();
  const auto fault = [&](const std::string& content) {
    std::ofstream(file) << content;
    try {
      readRecording(file);
    } catch (const WireError& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  const std::string head = "# smartmill-focas-session/1\n";
  EXPECT_NE(fault("something else\n").find("expected a file of format"), std::string::npos);
  EXPECT_NE(fault(head + "0.1 1 > a0a0\n").find(":2: expected one complete frame"), std::string::npos);
  EXPECT_NE(fault(head + "# x\n0.1 1 ? a0a0\n").find(":3: expected TIME CONNECTION"), std::string::npos);
  EXPECT_NE(fault(head + "0.1 1 > zz\n").find("'zz', expected a byte"), std::string::npos);
  EXPECT_EQ(fault(head + "0.1 1 > a0a0a0a0000102010000\n"), "");
  std::remove(file.c_str());
}

}  // namespace
}  // namespace smartmill::focas
