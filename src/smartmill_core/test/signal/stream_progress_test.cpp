#include "smartmill_core/signal/stream_progress.h"

#include <string>

#include <gtest/gtest.h>

namespace smartmill {
namespace {

constexpr double LIMIT = 0.4;    // [s]
constexpr double START = 1.7e9;  // [s]
constexpr double PERIOD = 0.01;  // [s] of the stamps of each stream
constexpr double TICK = 0.05;    // [s]
constexpr double PROMPT = 0.5;   // [s] time in which a fault is to be announced

/// Three streams of which the last has a fault after 2 s.
enum class Fault { none, silent, delayed };
struct Announcement {
  double announced = 0.0;  // [s] after the fault; 0: not
  std::string line;
};
double arrivalOf(double t, Fault fault) {
  if (t < 2.0 || fault == Fault::none) return t;
  return fault == Fault::silent ? 1e9 : t + 0.3;
}

/// @param live by ticks, else by steps of 0.1 s
Announcement announce(Fault fault, bool live) {
  StreamProgress progress;
  for (int i = 0; i < 3; ++i) progress.add(LIMIT);
  Announcement found;
  int next = 0;  // message of the last stream
  for (int k = 0; k < 500; ++k) {
    const double now = PERIOD * k;
    progress.heard(0, START + now);
    progress.heard(1, START + now - 0.02);
    for (; arrivalOf(PERIOD * next, fault) <= now + 1e-9; ++next) progress.heard(2, START + PERIOD * next);
    if (live && k % 5 == 0) progress.tick(TICK, START + now);
    if (!live && k % 10 == 0) progress.step();
    for (const auto& [stream, line] : progress.takeLines()) {
      EXPECT_EQ(stream, 2u) << line;
      if (found.line.empty()) found = {now - 2.0, line};
    }
  }
  return found;
}

TEST(StreamProgress, SilentAndDelayedStreamsAreAnnounced) {
  for (const bool live : {true, false}) {
    EXPECT_EQ(announce(Fault::none, live).line, "");
    const Announcement silent = announce(Fault::silent, live), delayed = announce(Fault::delayed, live);
    EXPECT_GT(silent.announced, 0.3);
    EXPECT_LE(silent.announced, PROMPT);
    EXPECT_EQ(silent.line.rfind("no data for 0.", 0), 0u) << silent.line;
    EXPECT_GT(delayed.announced, 0.2);
    EXPECT_LE(delayed.announced, PROMPT);
    EXPECT_NE(delayed.line.find(" s behind the other inputs at "), std::string::npos) << delayed.line;
  }
}

// After a pause of the node the messages of 3 s come at once, as many of each topic at a time: those of the
// faster topic lag behind until all have been taken.
TEST(StreamProgress, AQueueThatIsProcessedIsNoFault) {
  StreamProgress progress;
  for (int i = 0; i < 3; ++i) progress.add(LIMIT);
  for (int k = 0; k < 100; ++k) {
    for (std::size_t i = 0; i < 3; ++i) progress.heard(i, START + PERIOD * k);
  }
  progress.tick(TICK, START + 1.0);
  for (int k = 0; k < 300; ++k) {
    progress.heard(0, START + 1.0 + PERIOD * k);
    progress.heard(1, START + 1.0 + PERIOD * k);
    progress.heard(2, START + 1.0 + 0.5 * PERIOD * k);
    if (k % 50 == 0) progress.tick(TICK, START + 4.0);
  }
  EXPECT_TRUE(progress.takeLines().empty());
}

TEST(StreamProgress, ARestartedRecordingBeginsAnew) {
  StreamProgress progress;
  for (int i = 0; i < 3; ++i) progress.add(LIMIT);
  for (std::size_t i = 0; i < 3; ++i) progress.heard(i, START + 100.0);
  progress.heard(0, START);
  for (int k = 0; k < 20; ++k) progress.step();
  EXPECT_TRUE(progress.takeLines().empty());
}

}  // namespace
}  // namespace smartmill
