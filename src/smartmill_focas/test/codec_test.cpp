#include "smartmill_focas/codec.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "test_wire.h"

namespace smartmill::focas {
namespace {

// The byte strings are those of the interoperability notes.
TEST(Codec, OpenRequest) {
  EXPECT_EQ(show(encodeFrame(FRAME_OPEN, DIR_REQUEST, Writer().u16(1).data(), REQUEST_VERSION)),
            show(hex("a0a0a0a0 0001 0101 0002 0001")));
}

TEST(Codec, OpenReplyHasTheBodyOfTheNotes) {
  Bytes expected(72, 0);
  expected[7] = 3;
  for (int i : {9, 11, 21, 29, 41}) {
    expected[static_cast<std::size_t>(i)] = 1;
  }
  EXPECT_EQ(show(encodeOpenReply(OpenReply())), show(expected));
  const OpenReply back = decodeOpenReply(expected);
  EXPECT_EQ(back.axes, 3);
  EXPECT_EQ(back.spindles, 1);
  EXPECT_EQ(back.paths, 1);
  EXPECT_TRUE(back.spindle_meter);
  EXPECT_TRUE(back.extended);
  EXPECT_FALSE(decodeOpenReply(Bytes(72, 0)).spindle_meter);
}

TEST(Codec, RequestBytes) {
  struct Case {
    std::string expected;
    std::vector<SubRequest> requests;
  };
  const Bytes value = Writer().value8({123456, 10, 3}).data();
  const std::vector<Case> cases{
      {"001e 0001 001c 0001 0001 0018 Z20", {SubRequest(OP_SYSTEM_INFO)}},
      {"0056 0003 001c 0001 0001 0019 Z20 001c 0001 0001 00e1 Z20 001c 0001 0001 0098 Z20",
       {SubRequest(OP_STATUS), SubRequest(OP_HDCK), SubRequest(OP_TMMODE)}},
      {"001e 0001 001c 0001 0001 0025 Z20", {SubRequest(OP_ACTUAL_SPEED)}},
      {"0056 0003 001c 00010001 00a4 00000001 Z16 001c 00010001 0040 00000003 00000001 Z12 001c 00010001 "
       "00a4 00000001 "
       "Z16",
       {SubRequest(OP_LOCK, 1), SubRequest(OP_SPINDLE, 3, 1), SubRequest(OP_LOCK, 1)}},
      {"001e 0001 001c 0001 0001 0026 00000007 ffffffff Z12", {SubRequest(OP_POSITION, 7, -1)}},
      {"001e 0001 001c 0001 0001 0015 000001f4 000001f4 Z12", {SubRequest(OP_READ_MACRO, 500, 500)}},
      {"0026 0001 0024 0001 0001 0016 000001f4 000001f4 00000000 00000000 00000008 0001e240 000a 0003",
       {SubRequest(OP_WRITE_MACRO, 500, 500, 0, 0, value)}},
  };
  for (const Case& c : cases) {
    const Bytes body = encodeRequests(c.requests);
    EXPECT_EQ(show(encodeFrame(FRAME_DATA, DIR_REQUEST, body, REQUEST_VERSION)),
              show(hex("a0a0a0a0 0001 2101" + c.expected)));
    const std::vector<SubRequest> back = decodeRequests(body);
    ASSERT_EQ(back.size(), c.requests.size());
    for (std::size_t i = 0; i < back.size(); ++i) {
      EXPECT_EQ(back[i].c3, c.requests[i].c3);
      EXPECT_EQ(back[i].v, c.requests[i].v);
      EXPECT_EQ(back[i].extra, c.requests[i].extra);
    }
  }
}

TEST(Codec, ReplyBytes) {
  FrameReader reader;
  const Bytes wire =
      hex("a0a0a0a0 0003 2102 001a 0001 0018 0001 0001 0025 000000000000 0008 00001388 000a 0000");
  reader.append(wire.data(), wire.size());
  const std::optional<Frame> frame = reader.next();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->version, 3);
  const std::vector<SubReply> replies = decodeReplies(frame->body);
  ASSERT_EQ(replies.size(), 1u);
  EXPECT_EQ(replies[0].c3, OP_ACTUAL_SPEED);
  EXPECT_EQ(Reader(replies[0].data).value8().toDouble(), 5000.0);
  EXPECT_EQ(show(encodeFrame(FRAME_DATA, DIR_REPLY, encodeReplies(replies), REPLY_VERSION)), show(wire));
}

TEST(Codec, ErrorFrameOfALiveRefusal) {
  FrameReader reader;
  const Bytes wire = hex("a0a0a0a0 0003 0103 0008 0000 0002 0000 0000");
  reader.append(wire.data(), wire.size());
  const std::optional<Frame> frame = reader.next();
  ASSERT_TRUE(frame);
  EXPECT_TRUE(frame->is(FRAME_OPEN, DIR_ERROR));
  EXPECT_EQ(decodeErrorBody(frame->body).code, 2);
  EXPECT_EQ(decodeErrorBody({}).code, EW_PROTOCOL);
}

TEST(Codec, Value8) {
  EXPECT_EQ((Value8{5000, 10, 0}).toDouble(), 5000.0);
  EXPECT_EQ((Value8{123456, 10, 3}).toDouble(), 123.456);
  EXPECT_EQ((Value8{-5, 2, 1}).toDouble(), -2.5);  // base 2 is accepted
  EXPECT_TRUE(std::isnan((Value8{0, 10, -1}).toDouble()));
  const Bytes vacant = Writer().value8(Value8::vacantValue()).data();
  EXPECT_EQ(show(vacant), "00000000000affff");
  EXPECT_EQ(Value8::fromDouble(-1.23456, 3).value, -1235);
  EXPECT_EQ(Value8::fromDouble(1e12, 3).value, std::numeric_limits<std::int32_t>::max());
  EXPECT_TRUE(Value8::fromDouble(std::nan(""), 3).vacant());
  const Value8 macro = Value8::fromMacro(123.456);
  EXPECT_EQ(macro.value, 123456);
  EXPECT_EQ(macro.exp, 3);
  // Nine significant digits: the rounding error is at most half a unit of the ninth.
  std::mt19937 random(1);
  std::uniform_real_distribution<double> exponent(-6.0, 8.9), sign(-1.0, 1.0);
  for (int i = 0; i < 1000; ++i) {
    const double value = std::copysign(std::pow(10.0, exponent(random)), sign(random));
    EXPECT_NEAR(Value8::fromMacro(value).toDouble(), value, std::max(0.51e-9, 5.1e-9 * std::abs(value)));
  }
}

TEST(Codec, NumbersAreBigEndian) {
  EXPECT_EQ(show(Writer().u16(0x1234).i32(-2).f64(1.0).data()), "1234fffffffe3ff0000000000000");
  const Bytes data = hex("1234 fffffffe 3ff0000000000000");
  Reader reader(data);
  EXPECT_EQ(reader.u16(), 0x1234);
  EXPECT_EQ(reader.i32(), -2);
  EXPECT_EQ(reader.f64(), 1.0);
  EXPECT_THROW(reader.u8(), WireError);
}

TEST(Codec, FramesAreAssembledFromChunks) {
  Bytes wire;
  for (int i = 0; i < 5; ++i) {
    const Bytes frame =
        encodeFrame(FRAME_DNC_DATA, DIR_STREAM, Bytes(static_cast<std::size_t>(i * 700), 0x41), 1);
    wire.insert(wire.end(), frame.begin(), frame.end());
  }
  for (std::size_t piece : {1u, 3u, 9u, 10u, 11u, 1000u, 100000u}) {
    FrameReader reader;
    std::size_t frames = 0;
    for (std::size_t at = 0; at < wire.size(); at += piece) {
      reader.append(wire.data() + at, std::min(piece, wire.size() - at));
      while (const std::optional<Frame> frame = reader.next()) {
        EXPECT_EQ(frame->body.size(), 700 * frames);
        ++frames;
      }
    }
    EXPECT_EQ(frames, 5u);
    EXPECT_EQ(reader.buffered(), 0u);
  }
}

TEST(Codec, AWrongMagicNumberIsDetectedAtItsFirstByte) {
  FrameReader reader;
  const std::uint8_t bytes[] = {0xa0, 0xa0, 0x47};
  reader.append(bytes, 2);
  EXPECT_FALSE(reader.next());
  reader.append(bytes + 2, 1);
  EXPECT_THROW(reader.next(), WireError);
}

TEST(Codec, LengthsThatDoNotFitAreRefused) {
  EXPECT_THROW(encodeFrame(FRAME_DATA, DIR_REQUEST, Bytes(70000), 1), WireError);
  EXPECT_THROW(decodeRequests(hex("0001 001b 0001 0001 0018 Z20")), WireError);  // shorter than a request
  EXPECT_THROW(decodeRequests(hex("0001 0030 0001 0001 0018 Z20")), WireError);  // longer than the body
  EXPECT_THROW(decodeRequests(hex("0002 001c 0001 0001 0018 Z20")), WireError);  // one is missing
  EXPECT_THROW(decodeRequests({}), WireError);
  EXPECT_THROW(decodeReplies(hex("0001 000f 0001 0001 0018 Z8")), WireError);
  EXPECT_EQ(decodeReplies(hex("0001 0010 0001 0001 0018 0000 0000 0000 ffff"))[0].data.size(), 0u);
}

// Random bytes and randomly damaged frames are decoded or throw WireError.
TEST(Codec, MalformedInputThrowsWireErrorOnly) {
  std::mt19937 random(7);
  const Bytes good =
      encodeRequests({SubRequest(OP_STATUS), SubRequest(OP_WRITE_MACRO, 1, 1, 0, 0, Bytes(8, 1))});
  const Bytes good_reply = encodeReplies({SubReply{1, 1, 2, 0, 0, Bytes(24, 3)}, SubReply{}});
  for (int i = 0; i < 20000; ++i) {
    Bytes body = i % 3 == 0 ? good : i % 3 == 1 ? good_reply : Bytes(random() % 64);
    for (std::size_t damage = 0; damage < 1 + random() % 6 && !body.empty(); ++damage) {
      body[random() % body.size()] = static_cast<std::uint8_t>(random());
    }
    body.resize(random() % 4 == 0 ? random() % (body.size() + 1) : body.size());
    try {
      decodeRequests(body);
    } catch (const WireError&) {
    }
    try {
      decodeReplies(body);
    } catch (const WireError&) {
    }
    decodeOpenReply(body);
    decodeErrorBody(body);
    FrameReader reader;
    reader.append(body.data(), body.size());
    try {
      while (reader.next()) {
      }
    } catch (const WireError&) {
    }
  }
}

}  // namespace
}  // namespace smartmill::focas
