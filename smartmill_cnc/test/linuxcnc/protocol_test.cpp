#include "smartmill_cnc/linuxcnc/protocol.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "smartmill_core/error.h"

namespace smartmill::cnc::linuxcnc {
namespace {

MachineStatus someStatus() {
  MachineStatus status;
  status.alive = status.homed = true;
  status.state = MachineStatus::State::on;
  status.mode = MachineStatus::Mode::mdi;
  status.in_position = false;
  status.line = -7;
  status.running = 12;
  status.done = 11;
  status.velocity = 0.025;
  status.position = {1e-3, -2.5, 0.1};
  status.offset = {0.0, 0.5, -1e-9};
  status.heartbeat = 4'000'000'000u;
  status.starved = 0.125;
  status.errors = "one; two";
  return status;
}

ServoBlock someBlock(std::size_t count) {
  ServoBlock block;
  block.first = 4'294'967'290u;
  for (std::size_t i = 0; i < count; ++i) {
    ServoSample s;
    s.position = {0.1 * static_cast<double>(i), -1.0, 2.0};
    s.revolutions = 1e6 + 0.1;
    s.marker = 3.0;
    s.tool = 12.0;
    block.samples.push_back(s);
  }
  return block;
}

std::vector<Message> everyKind() {
  return {Command{CommandCode::run, 5, 1.5, "G1 X1\n"},
          Reply{Reply::Code::not_yet, "later"},
          StatusRequest{},
          someStatus(),
          someBlock(3),
          SetLoad{0.25},
          SetOverrides{0.4, 1.125}};
}

std::string refusalOf(const std::string& bytes) {
  FrameDecoder decoder;
  decoder.push(bytes.data(), bytes.size());
  try {
    decoder.next();
  } catch (const Error& e) {
    return e.what();
  }
  return {};
}

TEST(Protocol, EveryKindIsDecodedByteByByte) {
  FrameDecoder decoder;
  std::uint16_t sequence = 65530;
  for (const Message& message : everyKind()) {
    const std::string bytes = encode(message, ++sequence);
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      ASSERT_FALSE(decoder.next()) << "complete after " << i << " of " << bytes.size();
      decoder.push(&bytes[i], 1);
    }
    const std::optional<Received> received = decoder.next();
    ASSERT_TRUE(received);
    EXPECT_EQ(received->sequence, sequence);
    EXPECT_EQ(received->message.index(), message.index());
    EXPECT_EQ(encode(received->message, sequence), bytes);
  }
  EXPECT_EQ(decoder.waiting(), 0u);
}

TEST(Protocol, FieldsAreUnchanged) {
  FrameDecoder decoder;
  const std::string bytes = encode(someStatus()) + encode(someBlock(2));
  decoder.push(bytes.data(), bytes.size());
  const auto status = std::get<MachineStatus>(decoder.next()->message);
  EXPECT_TRUE(status.alive && status.homed && !status.in_position && !status.held);
  EXPECT_EQ(status.mode, MachineStatus::Mode::mdi);
  EXPECT_EQ(status.line, -7);
  EXPECT_EQ(status.position[1], -2.5);
  EXPECT_EQ(status.offset[2], -1e-9);
  EXPECT_EQ(status.heartbeat, 4'000'000'000u);
  EXPECT_EQ(status.starved, 0.125);
  EXPECT_EQ(status.errors, "one; two");
  const auto block = std::get<ServoBlock>(decoder.next()->message);
  EXPECT_EQ(block.first, 4'294'967'290u);
  EXPECT_EQ(block.samples.at(1).position[0], 0.1);
  EXPECT_EQ(block.samples.at(1).marker, 3.0);
  EXPECT_EQ(block.samples.at(1).tool, 12.0);
}

TEST(Protocol, InvalidFramesAreRefusedInOneLine) {
  const std::string good = encode(StatusRequest{});
  const auto with = [&](std::size_t place, char value) {
    std::string bytes = good;
    bytes[place] = value;
    return refusalOf(bytes);
  };
  EXPECT_NE(with(4, 1).find("version 1"), std::string::npos);
  EXPECT_NE(with(5, 0).find("kind 0"), std::string::npos);
  EXPECT_NE(with(5, 8).find("kind 8"), std::string::npos);
  // Too long a frame is refused before its payload arrives.
  EXPECT_NE(with(0, 1).find("at most 0"), std::string::npos);
  std::string endless = encode(Command{});
  endless[3] = 0x7f;
  EXPECT_NE(refusalOf(endless).find("at most"), std::string::npos);
  std::string load = encode(SetLoad{std::numeric_limits<double>::quiet_NaN()});
  EXPECT_NE(refusalOf(load).find("not finite"), std::string::npos);
  std::string code = encode(Command{});
  code[8] = 99;
  EXPECT_NE(refusalOf(code).find("unknown value 99"), std::string::npos);
  std::string text = encode(Reply{Reply::Code::done, "abc"});
  text[9] = 4;  // longer than the frame
  EXPECT_NE(refusalOf(text).find("too short"), std::string::npos);
  text[9] = 2;
  EXPECT_NE(refusalOf(text).find("1 bytes too long"), std::string::npos);
}

TEST(Protocol, LengthsAreBounded) {
  EXPECT_THROW(encode(Command{CommandCode::run, 1, 0.0, std::string(LONGEST_PROGRAM + 1, 'x')}), Error);
  EXPECT_THROW(encode(someBlock(ServoBlock::MOST + 1)), Error);
  EXPECT_EQ(refusalOf(encode(someBlock(ServoBlock::MOST))), "");
  EXPECT_EQ(refusalOf(encode(Command{CommandCode::run, 1, 0.0, std::string(LONGEST_PROGRAM, 'x')})), "");
  // The text of a reply is truncated, not refused.
  EXPECT_EQ(refusalOf(encode(Reply{Reply::Code::refused, std::string(100'000, 'x')})), "");
}

TEST(Protocol, RandomBytesAreDecodedOrRefused) {
  std::mt19937 random(7);
  std::uniform_int_distribution<int> byte(0, 255);
  for (int round = 0; round < 20'000; ++round) {
    const std::vector<Message> messages = everyKind();
    std::string bytes = encode(messages[static_cast<std::size_t>(round) % messages.size()]);
    for (int change = 0; change < 3; ++change) {
      bytes[static_cast<std::size_t>(random()) % bytes.size()] = static_cast<char>(byte(random));
    }
    FrameDecoder decoder;
    decoder.push(bytes.data(), bytes.size());
    try {
      while (decoder.next()) {
      }
    } catch (const Error& e) {
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
    }
  }
}

}  // namespace
}  // namespace smartmill::cnc::linuxcnc
