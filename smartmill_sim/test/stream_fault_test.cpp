#include "smartmill_sim/faults/stream_fault.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Two channels, four samples of 100 Hz: sample i is i, and 100 + i.
SampleBlock blockOf(int number) {
  SampleBlock block;
  block.stamp = 50.0 + 0.04 * number;
  block.sample_rate = 100.0;
  block.first_index = static_cast<std::uint64_t>(4 * number);
  block.channels = {"fx", "fy"};
  block.units = {"N", "N"};
  for (int i = 4 * number; i < 4 * number + 4; ++i) {
    block.samples.push_back(i);
    block.samples.push_back(100.0 + i);
  }
  return block;
}

SpindleAngle readingOf(int number, double speed = 50.0) {
  const double time = 0.01 * number;
  return {50.0 + time, std::fmod(speed * time, units::TWO_PI), speed};
}

/// What arrives in place of 10 blocks, with a fault from 0.08 s to 0.24 s: of the blocks 2 to 5.
std::vector<SampleBlock> withFault(const std::string& name, double value = 0.0) {
  FaultyStream<SampleBlock> stream;
  stream.add(makeFault(name, 0.0799, 0.16, value));
  std::vector<SampleBlock> arrived;
  for (int k = 0; k < 10; ++k) {
    for (const SampleBlock& block : stream.push(blockOf(k))) arrived.push_back(block);
  }
  return arrived;
}

std::vector<std::uint64_t> indicesOf(const std::vector<SampleBlock>& blocks) {
  std::vector<std::uint64_t> indices;
  for (const SampleBlock& block : blocks) indices.push_back(block.first_index);
  return indices;
}

TEST(FaultyStream, OffIntermittentAndDuplicatedChangeTheBlocksThatArrive) {
  EXPECT_THAT(indicesOf(withFault("off")), ElementsAre(0, 4, 24, 28, 32, 36));
  EXPECT_THAT(indicesOf(withFault("intermittent", 0.08)), ElementsAre(0, 4, 12, 20, 24, 28, 32, 36));
  EXPECT_THAT(indicesOf(withFault("duplicated")),
              ElementsAre(0, 4, 8, 8, 12, 12, 16, 16, 20, 20, 24, 28, 32, 36));
}

TEST(FaultyStream, ASlowStreamLosesNoSample) {
  const std::vector<SampleBlock> arrived = withFault("slow", 2.0);
  EXPECT_THAT(indicesOf(arrived), ElementsAre(0, 4, 8, 16, 24, 28, 32, 36));
  EXPECT_EQ(arrived[2].size(), 8u);
  EXPECT_EQ(arrived[2].at(7, 1), 115.0);
}

TEST(FaultyStream, ADelayedStreamArrivesLaterInOrder) {
  FaultyStream<SampleBlock> stream;
  stream.add(makeFault("delayed", 0.0, 0.0, 0.08));
  EXPECT_TRUE(stream.push(blockOf(0)).empty());
  EXPECT_TRUE(stream.push(blockOf(1)).empty());
  EXPECT_THAT(indicesOf(stream.push(blockOf(2))), ElementsAre(0));
  EXPECT_THAT(indicesOf(stream.push(blockOf(3))), ElementsAre(4));
  EXPECT_THAT(indicesOf(stream.flush()), ElementsAre(8, 12));
}

TEST(FaultyStream, ValuesAreDistortedInTheSpanOnly) {
  for (const char* name : {"stuck", "garbage", "scale", "sign", "swapped"}) {
    const std::vector<SampleBlock> arrived = withFault(name);
    ASSERT_EQ(arrived.size(), 10u);
    for (const std::size_t k : {0u, 1u, 6u, 9u})
      EXPECT_EQ(arrived[k].samples, blockOf(static_cast<int>(k)).samples);
  }
  EXPECT_EQ(withFault("stuck")[4].at(2, 1), 107.0);
  EXPECT_EQ(withFault("scale", 2.0)[2].at(1, 0), 18.0);
  EXPECT_EQ(withFault("sign")[2].at(1, 1), -109.0);
  EXPECT_EQ(withFault("swapped")[2].at(1, 0), 109.0);
  const SampleBlock garbage = withFault("garbage")[2];
  EXPECT_TRUE(std::isnan(garbage.samples[0]));
  EXPECT_TRUE(std::isinf(garbage.samples[1]));
  EXPECT_EQ(garbage.samples[2], 1e30);
}

TEST(FaultyStream, RateAndStampsAreThoseOfTheFault) {
  EXPECT_EQ(withFault("wrong_rate", 0.5)[2].sample_rate, 50.0);
  EXPECT_NEAR(withFault("clock_step", -2.0)[2].stamp, 48.08, 1e-9);
  EXPECT_NEAR(withFault("clock_step", -2.0)[6].stamp, 50.24, 1e-9);
}

TEST(FaultyStream, AngleOfAnotherGearAdvancesByItsSpeed) {
  FaultyStream<SpindleAngle> stream;
  stream.add(makeFault("scale", 0.095, 0.0, 1.5));
  SpindleAngle before = readingOf(0);
  for (int k = 0; k < 100; ++k) {
    const SpindleAngle reading = stream.push(readingOf(k)).at(0);
    if (k > 10) {
      EXPECT_NEAR(reading.speed, 75.0, 1e-9);
      EXPECT_NEAR(std::remainder(reading.angle - before.angle - 0.75, units::TWO_PI), 0.0, 1e-9) << k;
    }
    before = reading;
  }
}

TEST(FaultyStream, AFaultOnCommandBeginsWithTheNextItem) {
  FaultyStream<SpindleAngle> stream;
  for (int k = 0; k < 5; ++k) stream.push(readingOf(k));
  stream.begin(makeFault("off", 0.0, 0.025, 0.0));
  EXPECT_TRUE(stream.push(readingOf(5)).empty());
  EXPECT_TRUE(stream.push(readingOf(6)).empty());
  EXPECT_EQ(stream.push(readingOf(7)).size(), 1u);
  stream.begin(makeFault("off", 0.0, 0.0, 0.0));
  EXPECT_TRUE(stream.push(readingOf(8)).empty());
  stream.clear();
  EXPECT_EQ(stream.push(readingOf(9)).size(), 1u);
}

TEST(FaultyStream, ABackwardJumpBeginsAnew) {
  FaultyStream<SpindleAngle> stream;
  stream.add(makeFault("off", 0.045, 0.0, 0.0));
  for (int run = 0; run < 2; ++run) {
    std::size_t arrived = 0;
    for (int k = 0; k < 200; ++k) arrived += stream.push(readingOf(k)).size();
    EXPECT_EQ(arrived, 5u);
  }
}

TEST(Faults, AreReadFromText) {
  const std::vector<TopicFault> faults =
      readFaults("daq/dynamometer stuck 10 2; spindle/angle scale 14 0 1.1;");
  ASSERT_EQ(faults.size(), 2u);
  EXPECT_EQ(faults[0].topic, "daq/dynamometer");
  EXPECT_EQ(faults[0].fault.kind, FaultKind::stuck);
  EXPECT_EQ(faults[0].fault.duration, 2.0);
  EXPECT_EQ(faults[1].fault.value, 1.1);
  EXPECT_TRUE(std::isinf(faults[1].fault.duration));
  EXPECT_TRUE(readFaults("").empty());
}

TEST(Faults, WrongOnesAreRefusedWithOneLine) {
  const auto message = [](const std::string& text) -> std::string {
    try {
      readFaults(text);
    } catch (const Error& error) {
      return error.what();
    }
    return {};
  };
  EXPECT_THAT(message("daq/hammer loud 1 2"), HasSubstr("fault 'loud' is unknown, expected off, stuck"));
  EXPECT_THAT(message("daq/hammer stuck 1"), HasSubstr("expected TOPIC FAULT BEGIN DURATION [VALUE]"));
  EXPECT_THAT(message("daq/hammer stuck 1 2 3 4"), HasSubstr("expected TOPIC FAULT BEGIN DURATION [VALUE]"));
  EXPECT_THAT(message("daq/hammer stuck -1 2"), HasSubstr("begin and duration >= 0 s"));
  EXPECT_THAT(message("daq/hammer delayed 1 2 -3"), HasSubstr("expected a value above 0"));
  EXPECT_THROW(FaultyStream<SpindleAngle>().add(makeFault("swapped", 0.0, 0.0, 0.0)), Error);
}

}  // namespace
}  // namespace smartmill::sim
