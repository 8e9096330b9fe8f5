// A session through the tap into a file, and recorded sessions played back to the client and to the server.
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
const char* const SIMULATED = "test/sessions/simulated_30i.focas";  // tests run in the package's folder

Bytes wire(const Frame& f) {
  return encodeFrame(f.type, f.direction, f.body, f.version);
}

/// A controller that answers a recorded connection's frames in their order and nothing else.
class Replayed {
 public:
  explicit Replayed(const std::vector<RecordedFrame>& frames) {
    for (const RecordedFrame& frame : frames) {
      connections_[frame.connection].push_back(frame);
    }
    thread_ = std::thread([this] { run(); });
  }
  ~Replayed() { thread_.join(); }
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
      const Bytes due = wire(frame.frame);
      if (!frame.from_client) {
        socket.send(due);
        ++answered_;
        continue;
      }
      const Bytes came = socket.receive(due.size());
      if (came != due) {
        const std::lock_guard<std::mutex> lock(mutex_);
        fault_ += "asked " + show(came) + "\nwhere " + show(due) + " was recorded\n";
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

TEST_F(ServerTest, TapHandsOnEveryByteAndTellsEveryFrame) {
  const std::string file = (std::filesystem::temp_directory_path() / "smartmill_tap_test.focas").string();
  std::size_t told = 0;
  {
    std::ofstream out(file);
    beginRecording(out);
    std::mutex mutex;
    Tap tap(0, "127.0.0.1", server_.port(), TIMEOUT, [&](const RecordedFrame& frame) {
      const std::lock_guard<std::mutex> lock(mutex);
      append(out, frame);
      ++told;
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
  EXPECT_EQ(frames.size(), told);
  // Every request but the DNC text has its answer.
  const auto asked = std::count_if(frames.begin(), frames.end(), [](const auto& f) { return f.from_client; });
  EXPECT_EQ(2 * asked - 1, static_cast<long>(frames.size()));
  std::remove(file.c_str());
}

TEST(Recording, ClientAsksAndReadsAsInTheRecordedSession) {
  const std::vector<RecordedFrame> frames = readRecording(SIMULATED);
  Replayed controller(frames);
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

/// The requests of a recording get replies of the same shape from the server: same calls, codes and lengths.
TEST_F(ServerTest, ServerAnswersTheRecordedRequestsInTheSameShape) {
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
    const std::vector<SubReply> due = decodeReplies(recorded.frame.body), got = decodeReplies(reply.body);
    ASSERT_EQ(got.size(), due.size());
    for (std::size_t i = 0; i < got.size(); ++i) {
      EXPECT_EQ(got[i].c3, due[i].c3);
    }
  }
}

TEST(Recording, WhatIsNoRecordingIsNamedWithItsLine) {
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
  EXPECT_NE(fault("something else\n").find("not a file of format"), std::string::npos);
  EXPECT_NE(fault(head + "0.1 1 > a0a0\n").find(":2: not one whole frame"), std::string::npos);
  EXPECT_NE(fault(head + "# x\n0.1 1 ? a0a0\n").find(":3: TIME CONNECTION"), std::string::npos);
  EXPECT_NE(fault(head + "0.1 1 > zz\n").find("'zz' is no byte"), std::string::npos);
  EXPECT_EQ(fault(head + "0.1 1 > a0a0a0a0000102010000\n"), "");
  std::remove(file.c_str());
}

}  // namespace
}  // namespace smartmill::focas
