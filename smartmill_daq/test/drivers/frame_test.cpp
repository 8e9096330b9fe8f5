#include "smartmill_daq/drivers/frame.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "smartmill_core/error.h"

namespace smartmill::daq {
namespace {

using ::testing::HasSubstr;

Frame frame() {
  Frame frame;
  frame.format = SampleFormat::float32;
  frame.channels = 2;
  frame.first_index = 0x0102030405060708;
  frame.time = 1800000000123456789;
  frame.sample_rate = 51200.0;
  frame.overloaded = 2;
  frame.bias_fault = 1;
  frame.values = {1.0, -2.0, 0.5, 0.25};
  return frame;
}

// Written out by hand from the table of docs/daq.md.
TEST(Frame, hasTheDocumentedBytes) {
  const std::string expected(
      "SMD1\x03\x02\x00\x00\x02\x00\x00\x00\x10\x00\x00\x00\x08\x07\x06\x05\x04\x03\x02\x01"
      "\x15\xcd\x0f\x9b\x76\xe2\xfa\x18\x00\x00\x00\x00\x00\x00\xe9\x40\x02\x00\x00\x00\x00\x00\x00\x00"
      "\x01\x00\x00\x00\x00\x00\x00\x00\x00\x00\x80\x3f\x00\x00\x00\xc0\x00\x00\x00\x3f\x00\x00\x80\x3e",
      72);
  EXPECT_EQ(encode(frame()), expected);
}

TEST(Frame, comesBackFromAnyPieces) {
  for (const SampleFormat format :
       {SampleFormat::int16, SampleFormat::int32, SampleFormat::float32, SampleFormat::float64}) {
    Frame sent = frame();
    sent.format = format;
    sent.values = {-1.0, -0.5, 0.5, 0.25};
    const std::string bytes = encode(sent) + encode(sent);
    for (std::size_t piece = 1; piece < 80; piece += 13) {
      FrameDecoder decoder;
      int frames = 0;
      for (std::size_t at = 0; at < bytes.size(); at += piece) {
        decoder.push(bytes.data() + at, std::min(piece, bytes.size() - at));
        while (const auto got = decoder.next()) {
          ++frames;
          EXPECT_EQ(got->values, sent.values);
          EXPECT_EQ(got->first_index, sent.first_index);
          EXPECT_EQ(got->time, sent.time);
          EXPECT_EQ(got->sample_rate, sent.sample_rate);
          EXPECT_EQ(got->overloaded, sent.overloaded);
          EXPECT_EQ(got->bias_fault, sent.bias_fault);
        }
      }
      EXPECT_EQ(frames, 2);
    }
  }
}

TEST(Frame, otherBytesAreRefusedWithWhatIsWrong) {
  const auto refused = [](std::size_t at, char byte) {
    std::string bytes = encode(frame());
    bytes[at] = byte;
    FrameDecoder decoder;
    decoder.push(bytes.data(), bytes.size());
    try {
      decoder.next();
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_THAT(refused(0, 'X'), HasSubstr("begins with other bytes than SMD1"));
  EXPECT_THAT(refused(4, 9), HasSubstr("sample format 9, expected 1 to 4"));
  EXPECT_THAT(refused(5, 65), HasSubstr("65 channels, expected 1 to 64"));
  EXPECT_THAT(refused(8, 3), HasSubstr("do not hold 3 samples"));
  EXPECT_THAT(refused(15, 1), HasSubstr("more than 8 MiB"));
  EXPECT_THAT(refused(23, '\xff'), HasSubstr("index"));
  EXPECT_THAT(refused(39, '\xff'), HasSubstr("sample rate"));
}

}  // namespace
}  // namespace smartmill::daq
