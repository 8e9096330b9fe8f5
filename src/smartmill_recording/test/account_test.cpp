#include "smartmill_recording/account.h"

#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/names.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_recording/conversions.h"
#include "smartmill_recording/recording_writer.h"

namespace smartmill {
namespace {

constexpr double RATE = 10000.0;        // [Hz]
constexpr std::uint64_t SIZE = 100;     // samples of a block
constexpr std::uint64_t START = 50000;  // running index of the first sample
constexpr double STAMP = 1.7e9;         // [s] of that sample

// A second of sensor blocks and forces in one bag; the faults of a test drop or change messages.
class Account : public ::testing::Test {
 protected:
  struct Message {
    std::uint32_t sequence = 0;
    std::uint64_t first = 0;
    bool drop = false, nan = false;
  };
  using Fault = std::function<void(int, Message&)>;

  RecordingAccount of(
      const Fault& sensor, const Fault& force = [](int, Message&) {}, int parts = 1) {
    std::vector<std::string> paths;
    std::unique_ptr<RecordingWriter> writer;
    for (int k = 0; k < 100; ++k) {
      if (k % (100 / parts) == 0) {
        if (writer) writer->close();
        paths.push_back(folder_.file("part_" + std::to_string(k) + ".bag"));
        writer = createRecording(paths.back(), RecordingCompression::none);
      }
      const auto time = static_cast<std::uint64_t>((STAMP + 0.01 * k) * 1e9);
      const Message regular{static_cast<std::uint32_t>(k) + 7, START + SIZE * static_cast<std::uint64_t>(k)};
      Message m = regular;
      sensor(k, m);
      if (!m.drop) writer->write(names::DYNAMOMETER, time, sensorBlock(m));
      m = regular;
      force(k, m);
      if (!m.drop) writer->write(names::FORCE_COMPENSATED, time, forceBlock(m));
    }
    writer->close();
    return accountOf(paths);
  }
  static const StreamAccount& stream(const RecordingAccount& account, const char* topic) {
    for (const StreamAccount& s : account.streams) {
      if (s.topic == names::absolute(topic)) return s;
    }
    throw std::runtime_error(topic);
  }

 private:
  static double stampOf(const Message& m) { return STAMP + static_cast<double>(m.first - START) / RATE; }

  static plain::SampleBlock sensorBlock(const Message& m) {
    SampleBlock block;
    block.stamp = stampOf(m);
    block.sample_rate = RATE;
    block.first_index = m.first;
    block.channels = {"fx", "fy"};
    block.units = {"N", "N"};
    block.samples.assign(2 * SIZE, 1.0);
    if (m.nan) block.samples[5] = NAN;
    plain::SampleBlock message = toPlain(block);
    message.header.seq = m.sequence;
    return message;
  }
  static plain::ForceBlock forceBlock(const Message& m) {
    ForceBlock block;
    block.stamp = stampOf(m);
    block.sample_rate = RATE;
    block.first_index = m.first;
    for (auto& axis : block.force) axis.assign(SIZE, 2.0);
    plain::ForceBlock message = toPlain(block);
    message.header.seq = m.sequence;
    return message;
  }

  TemporaryFolder folder_;
};

TEST_F(Account, NothingIsMissing) {
  const RecordingAccount account = of([](int, Message&) {});
  EXPECT_TRUE(account.isComplete());
  ASSERT_EQ(account.streams.size(), 2u);
  for (const StreamAccount& s : account.streams) {
    EXPECT_EQ(s.messages, 100u);
    EXPECT_EQ(s.samples, 10000u);
    EXPECT_EQ(s.lost_messages + s.lost_samples + s.repeated_samples + s.not_finite, 0u);
    EXPECT_EQ(s.rate_stated, RATE);
    EXPECT_NEAR(s.rate_seen, RATE, 0.01);
  }
}

// Lost on the way: both the sequence numbers and the index jump, and the node did process the samples.
TEST_F(Account, AMessageLostBeforeTheRecorder) {
  const RecordingAccount account = of([](int k, Message& m) { m.drop = k == 40 || k == 41; });
  const StreamAccount& s = stream(account, names::DYNAMOMETER);
  EXPECT_EQ(s.lost_messages, 2u);
  EXPECT_EQ(s.lost_samples, 200u);
  ASSERT_EQ(account.gaps.size(), 2u);
  EXPECT_EQ(account.gaps[0].kind, StreamGap::Kind::messages);
  EXPECT_EQ(account.gaps[1].kind, StreamGap::Kind::samples);
  EXPECT_NEAR(account.gaps[1].stamp, STAMP + 0.42, 1e-6);
}

// Lost in the converter: only the index jumps, here and in the forces.
TEST_F(Account, SamplesLostBeforePublishing) {
  const auto jump = [](int k, Message& m) { m.first += k >= 60 ? 37 : 0; };
  const RecordingAccount account = of(jump, jump);
  EXPECT_EQ(stream(account, names::DYNAMOMETER).lost_messages, 0u);
  EXPECT_EQ(stream(account, names::DYNAMOMETER).lost_samples, 37u);
  for (const StreamGap& gap : account.gaps) EXPECT_EQ(gap.kind, StreamGap::Kind::samples);
  EXPECT_EQ(account.gaps.size(), 2u);
}

// A node that drops blocks without a trace in its own sequence numbers.
TEST_F(Account, SamplesWithoutAForce) {
  const RecordingAccount account = of([](int, Message&) {},
                                      [](int k, Message& m) {
                                        m.drop = k >= 20 && k < 25;
                                        if (k >= 25) m.sequence -= 5;
                                      });
  std::vector<StreamGap> unprocessed;
  for (const StreamGap& gap : account.gaps) {
    if (gap.kind == StreamGap::Kind::unprocessed) unprocessed.push_back(gap);
  }
  ASSERT_EQ(unprocessed.size(), 1u);
  EXPECT_EQ(unprocessed[0].count, 500u);
  EXPECT_NEAR(unprocessed[0].stamp, STAMP + 0.2, 1e-4);
  EXPECT_EQ(stream(account, names::FORCE_COMPENSATED).lost_messages, 0u);
}

TEST_F(Account, RepeatedAndNotFiniteSamples) {
  const RecordingAccount account = of([](int k, Message& m) {
    if (k == 30) m.first -= 40;
    m.nan = k == 50;
  });
  const StreamAccount& s = stream(account, names::DYNAMOMETER);
  EXPECT_EQ(s.repeated_samples, 40u);
  EXPECT_EQ(s.lost_samples, 40u);  // of the next block
  EXPECT_EQ(s.not_finite, 1u);
  EXPECT_FALSE(account.isComplete());
}

// A node that is started again counts from 0; what it received before counts as well.
TEST(NodeAccount, SumsAllStarts) {
  const TemporaryFolder folder;
  const auto writer = createRecording(folder.file("session.bag"), RecordingCompression::none);
  const auto write = [&](double started, std::uint32_t starts, std::uint64_t received, std::uint64_t lost) {
    plain::NodeHealth health;
    health.node = "/smartmill/kalman";
    health.started = started;
    health.starts = starts;
    plain::StreamHealth input;
    input.topic = "/smartmill/daq/dynamometer";
    input.received = received;
    input.lost = lost;
    input.dropped = 1;
    health.inputs = {input};
    writer->write(names::NODE_HEALTH, static_cast<std::uint64_t>(STAMP * 1e9) + received, health);
  };
  write(STAMP, 1, 100, 0);
  write(STAMP, 1, 200, 3);
  write(STAMP + 50.0, 2, 40, 2);
  writer->close();
  const RecordingAccount account = accountOf({folder.file("session.bag")});
  ASSERT_EQ(account.inputs.size(), 1u);
  EXPECT_EQ(account.inputs[0].topic, "/smartmill/daq/dynamometer");
  EXPECT_EQ(account.inputs[0].starts, 2u);
  EXPECT_EQ(account.inputs[0].received, 240u);
  EXPECT_EQ(account.inputs[0].lost, 5u);
  EXPECT_EQ(account.inputs[0].dropped, 2u);
  EXPECT_TRUE(account.gaps.empty());
  EXPECT_FALSE(account.isComplete());
}

TEST_F(Account, PublishersContinueFromOnePartOfARecordingToTheNext) {
  const RecordingAccount whole = of([](int, Message&) {}, [](int, Message&) {}, 4);
  EXPECT_TRUE(whole.isComplete());
  ASSERT_EQ(whole.streams.size(), 2u);
  EXPECT_EQ(stream(whole, names::DYNAMOMETER).messages, 100u);
  EXPECT_EQ(stream(whole, names::DYNAMOMETER).samples, 100 * SIZE);
  // The first message of the second part.
  const RecordingAccount lost = of([](int k, Message& m) { m.drop = k == 25; }, [](int, Message&) {}, 4);
  EXPECT_EQ(stream(lost, names::DYNAMOMETER).lost_messages, 1u);
  EXPECT_EQ(stream(lost, names::DYNAMOMETER).lost_samples, SIZE);
}

TEST(MissingRanges, AreThoseWithinThePresentOnes) {
  const auto missing = [](const std::vector<IndexRange>& all, const std::vector<IndexRange>& present) {
    std::vector<std::pair<std::uint64_t, std::uint64_t>> pairs;
    for (const IndexRange& r : missingRanges(all, present)) pairs.emplace_back(r.first, r.last);
    return pairs;
  };
  using Pairs = std::vector<std::pair<std::uint64_t, std::uint64_t>>;
  EXPECT_EQ(missing({{0, 99}}, {}), Pairs{});
  EXPECT_EQ(missing({{0, 99}}, {{10, 20}}), Pairs{});  // the ends are those of the node's start and end
  EXPECT_EQ(missing({{0, 99}}, {{10, 20}, {30, 40}}), (Pairs{{21, 29}}));
  EXPECT_EQ(missing({{0, 24}, {26, 99}}, {{10, 20}, {30, 40}}), (Pairs{{21, 24}, {26, 29}}));
}

}  // namespace
}  // namespace smartmill
