// Calls other than motion, byte by byte as in the interoperability notes and public descriptions of the
// protocol (README of pyfanuc, compare_read_diag.md).
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "server_rig.h"
#include "smartmill_focas/describe.h"

namespace smartmill::focas {
namespace {

using ConformanceTest = ServerTest;

const std::string OK6 = "000000000000";

/// count x "value, base 10, exp 0".
std::string zeroValues(int count) {
  std::string text;
  for (int i = 0; i < count; ++i) {
    text += "00000000 000a 0000";
  }
  return text;
}

TEST_F(ConformanceTest, ParametersAndDiagnosisOfA30i) {
  const auto data = open(2);
  // A real parameter of all axes: 250.000, 200.500, -0.001 and 29 empty slots.
  std::string fill;
  for (int i = 0; i < 29; ++i) {
    fill += "00000000 000a 0003";
  }
  expectReply(*data, "001e 0001 001c 0001 0001 008d 00000528 00000528 ffffffff Z8",
              "011a 0001 0118 0001 0001 008d" + OK6 +
                  "0108 00000528 ffff 0004 0003d090 000a 0003 00030f34 000a 0003 "
                  "ffffffff 000a 0003" +
                  fill);
  // The value of a single axis is in the first slot.
  expectReply(
      *data, "001e 0001 001c 0001 0001 008d 000003fc 000003fc 00000002 Z8",
      "011a 0001 0118 0001 0001 008d" + OK6 + "0108 000003fc 0002 0001 00000059 000a 0000" + zeroValues(31));
  expectReply(
      *data, "001e 0001 001c 0001 0001 008d 00000e9d 00000e9d 00000000 Z8",
      "011a 0001 0118 0001 0001 008d" + OK6 + "0108 00000e9d 0000 0003 00004e20 000a 0000" + zeroValues(31));
  // Sample of a 30i in pyfanuc: #308 of all axes, type 0.
  expectReply(*data, "001e 0001 001c 0001 0001 0093 00000134 00000134 ffffffff Z8",
              "011a 0001 0118 0001 0001 0093" + OK6 +
                  "0108 00000134 ffff 0000 0000001c 000a 0000 0000001c 000a 0000 "
                  "0000002c 000a 0000" +
                  zeroValues(29));
  // A missing number, a missing axis, an axis parameter without axis.
  expectReply(*data, "001e 0001 001c 0001 0001 008d 00000001 00000001 00000000 Z8",
              "0012 0001 0010 0001 0001 008d 0003 0000 0000 0000");
  expectReply(*data, "001e 0001 001c 0001 0001 008d 00000528 00000528 00000009 Z8",
              "0012 0001 0010 0001 0001 008d 0004 0000 0000 0000");
  expectReply(*data, "001e 0001 001c 0001 0001 008d 00000528 00000528 00000000 Z8",
              "0012 0001 0010 0001 0001 008d 0004 0000 0000 0000");
  // The legacy opcode: slots of four bytes, lengths in the least increment.
  expectReply(*data, "001e 0001 001c 0001 0001 000e 00000528 00000528 00000001 Z8",
              "009a 0001 0098 0001 0001 000e" + OK6 + "0088 00000528 0001 0004 0003d090 Z124");
}

TEST(Conformance31i, RefusesTheLegacyParameterOpcode) {
  TestController controller;
  controller.info.cnc_type = "31";
  ServerOptions options;
  options.port = 0;
  Server server(options, controller.calls());
  RawSocket socket(RawSocket::connectTo(server.port()));
  socket.send(hex("a0a0a0a0 0001 0101 0002 0002"));
  socket.receive(82);
  socket.send(hex("a0a0a0a0 0001 2101 001e 0001 001c 0001 0001 000e 00000528 00000528 00000001 Z8"));
  EXPECT_EQ(show(socket.receive(28)),
            show(hex("a0a0a0a0 0003 2102 0012 0001 0010 0001 0001 000e 0001 0000 0000 0000")));
}

TEST_F(ConformanceTest, ClockIsReadAndSet) {
  const auto data = open(2);
  // 2026-05-14 13:37:59; the date is in the first half, the time in the second.
  const std::string now = "000c 07ea 0005 000e 000d 0025 003b";
  expectReply(*data, "003a 0002 001c 0001 0001 0045 Z20 001c 0001 0001 0045 00000001 Z16",
              "003a 0002 001c 0001 0001 0045" + OK6 + now + "001c 0001 0001 0045" + OK6 + now);
  // cnc_settimer of the time alone: 6 zeros, then h m s.
  expectReply(*data, "002a 0001 0028 0001 0001 0046 00000001 Z12 0000000c Z6 0017 003b 0001",
              "0012 0001 0010 0001 0001 0046" + OK6 + "0000");
  EXPECT_EQ(controller_.locked(controller_.clock).hour, 23);
  EXPECT_EQ(controller_.locked(controller_.clock).year, 2026);
  expectReply(*data, "002a 0001 0028 0001 0001 0046 00000001 Z12 0000000c Z6 0018 003b 0001",
              "0012 0001 0010 0001 0001 0046 0005 0000 0000 0000");  // 24 o'clock
  expectReply(*data, "001e 0001 001c 0001 0001 0046 00000001 Z16",
              "0012 0001 0010 0001 0001 0046 0002 0000 0000 0000");  // no data
}

TEST_F(ConformanceTest, DoublesAreWrittenAllOrNone) {
  const auto data = open(2);
  const std::string one = "3ff0000000000000", request = " 0001 0001 00a8 000001f4 Z12 ";
  const std::string answer = "0012 0001 0010 0001 0001 00a8 ";
  controller_.change([](TestController& c) { c.macros[500] = 7.0; });
  // An incomplete double, an infinite one, missing numbers.
  expectReply(*data, "0029 0001 0027" + request + "0000000b" + one + "Z3", answer + "0002 0000 0000 0000");
  expectReply(*data, "002e 0001 002c" + request + "00000010" + one + "7ff0000000000000",
              answer + "0005 0000 0000 0000");
  expectReply(*data, "003e 0001 003c" + request + "00000020" + one + one + one + one,
              answer + "0003 0000 0000 0000");
  EXPECT_EQ(controller_.locked(controller_.macros)[500], 7.0);
  expectReply(*data, "0026 0001 0024" + request + "00000008" + one, answer + "0000 0000 0000 0000");
  EXPECT_EQ(controller_.locked(controller_.macros)[500], 1.0);
}

TEST_F(ConformanceTest, PmcRangesAreBigEndianOnTheWireAndLowByteFirstInMemory) {
  const auto data = open(2);
  expectReply(*data, "0022 0001 0020 0002 0001 8002 00000064 00000067 00000009 00000002 00000004 01020304",
              "0012 0001 0010 0002 0001 8002" + OK6 + "0000");
  expectReply(*data, "001e 0001 001c 0002 0001 8001 00000064 00000067 00000009 00000000 00000000",
              "0016 0001 0014 0002 0001 8001" + OK6 + "0004 04030201");
  expectReply(*data, "001e 0001 001c 0002 0001 8001 00000064 00000067 00000009 00000001 00000000",
              "0016 0001 0014 0002 0001 8001" + OK6 + "0004 0304 0102");
  expectReply(*data, "001e 0001 001c 0002 0001 8001 00000064 00000067 00000009 00000002 00000000",
              "0016 0001 0014 0002 0001 8001" + OK6 + "0004 01020304");
  // Beyond the memory, an unknown kind, a partial element, another PMC call.
  expectReply(*data, "001e 0001 001c 0002 0001 8001 000000c8 000000c8 00000009 Z8",
              "0012 0001 0010 0002 0001 8001 0003 0000 0000 0000");
  expectReply(*data, "001e 0001 001c 0002 0001 8001 00000000 00000000 0000000a Z8",
              "0012 0001 0010 0002 0001 8001 0004 0000 0000 0000");
  expectReply(*data, "001e 0001 001c 0002 0001 8001 00000000 00000002 00000009 00000001 Z4",
              "0012 0001 0010 0002 0001 8001 0002 0000 0000 0000");
  expectReply(*data, "001e 0001 001c 0002 0001 8055 Z20",
              "0012 0001 0010 0002 0001 8055 0001 0000 0000 0000");
}

TEST_F(ConformanceTest, ProgramListsAndFolders) {
  const auto data = open(2);
  // listprog of pyfanuc: 19 programs from a number on, u32 number, u32 size, 64 bytes of comment; ended by an
  // empty list.
  expectReply(*data, "001e 0001 001c 0001 0001 0006 00000002 00000013 00000002 Z8",
              "005a 0001 0058 0001 0001 0006" + OK6 + "0048 000004d2 00000064 \"(SLOT)\" Z58");
  expectReply(*data, "001e 0001 001c 0001 0001 0006 000004d3 00000013 00000002 Z8",
              "0012 0001 0010 0001 0001 0006" + OK6 + "0000");
  const std::string head = "011e 0001 011c 0001 0001 ";
  const std::string folder = " \"//CNC_MEM/USER/PATH1/\" Z235";
  expectReply(*data, head + "00b4 Z16 00000100" + folder,
              "001a 0001 0018 0001 0001 00b4" + OK6 + "0008 00000000 00000002");
  expectReply(
      *data, head + "00b3 00000000 00000001 00000000 00000001 00000100" + folder,
      "0092 0001 0090 0001 0001 00b3" + OK6 +
          "0080 0001 07ea 0005 000e 0008 001e 0001 Z6 00000028 00000000 \"O0001\" Z31 \"(PARK)\" Z46 Z12");
  expectReply(*data, head + "00b3 00000000 0000000a 00000000 00000001 00000100 \"//CNC_MEM\" Z247",
              "0092 0001 0090 0001 0001 00b3" + OK6 + "0080 0000 Z26 \"USER\" Z32 Z64");
  expectReply(*data, head + "00b4 Z16 00000100 \"//NOWHERE/\" Z246",
              "0012 0001 0010 0001 0001 00b4 0005 0000 0000 0000");
  expectReply(*data, "001e 0001 001c 0001 0001 00b0 00000001 Z16",
              "0112 0001 0110 0001 0001 00b0" + OK6 + "0100" + folder);
  expectReply(*data, head + "00ba Z16 00000100 \"//CNC_MEM/USER/PATH1/O1234\" Z230",
              "0012 0001 0010 0001 0001 00ba" + OK6 + "0000");
  expectReply(*data, "001e 0001 001c 0001 0001 0003 000004d2 Z16",
              "0012 0001 0010 0001 0001 0003" + OK6 + "0000");
  expectReply(*data, "001e 0001 001c 0001 0001 0005 00000007 Z16",
              "0012 0001 0010 0001 0001 0005 0005 0000 0000 0000");
  expectReply(*data, "001e 0001 001c 0001 0001 001f Z20", "0012 0001 0010 0001 0001 001f" + OK6 + "0000");
  expectReply(*data, "001e 0001 001c 0001 0001 0001 Z20",
              "0012 0001 0010 0001 0001 0001 0001 0000 0000 0000");  // a controller without cycle start
  // The running block, and servo currents in A.
  expectReply(*data, "001e 0001 001c 0001 0001 0020 00000006 Z16",
              "001c 0001 001a 0001 0001 0020" + OK6 + "000a 00000058 \"N77 G1\"");
  expectReply(*data, "001e 0001 001c 0001 0001 0056 00000003 Z16",
              "002a 0001 0028 0001 0001 0056" + OK6 +
                  "0018 000005dc 000a 0003 ffffff06 000a 0003 00000000 000a 0003");
}

TEST_F(ConformanceTest, DownloadAsCncDwnstart4AndItsPredecessor) {
  const auto stream = open(1);
  for (const std::string name : {"\"N://CNC_MEM/USER/PATH1/\" Z489", "Z512"}) {
    stream->send(hex("a0a0a0a0 0001 1101 0204 00000001 " + name));
    EXPECT_EQ(show(stream->receive(10)), show(hex("a0a0a0a0 0003 1102 0000")));
    stream->send(hex("a0a0a0a0 0001 1204 0007 0a \"O1234\" 0a"));
    stream->send(hex("a0a0a0a0 0001 1204 0005 \"M30\" 0a \"%\""));
    stream->send(hex("a0a0a0a0 0001 1301 0000"));
    EXPECT_EQ(show(stream->receive(10)), show(hex("a0a0a0a0 0003 1302 0000")));
    EXPECT_EQ(controller_.locked(controller_.stored), "\nO1234\nM30\n%");
  }
  // A start within a download, an end without a start, a program without a number.
  stream->send(hex("a0a0a0a0 0001 1101 0204 00000001 Z512 a0a0a0a0 0001 1101 0204 00000001 Z512"));
  EXPECT_EQ(show(stream->receive(28)),
            show(hex("a0a0a0a0 0003 1102 0000 a0a0a0a0 0003 1103 0008 0000 ffff 0000 0000")));
  stream->send(hex("a0a0a0a0 0001 1204 0001 \"X\" a0a0a0a0 0001 1301 0000"));
  EXPECT_EQ(show(stream->receive(18)), show(hex("a0a0a0a0 0003 1303 0008 0000 0005 0000 0000")));
  stream->send(hex("a0a0a0a0 0001 1301 0000"));
  EXPECT_EQ(show(stream->receive(18)), show(hex("a0a0a0a0 0003 1303 0008 0000 0001 0000 0000")));
  const auto data = open(2);
  data->send(hex("a0a0a0a0 0001 1101 0204 00000001 Z512"));
  EXPECT_EQ(show(data->receive(18)), show(hex("a0a0a0a0 0003 1103 0008 0000 0001 0000 0000")));
}

TEST_F(ConformanceTest, UploadAsCncUpstart4AndItsPredecessor) {
  const auto stream = open(1);
  for (const std::string name : {"\"N://CNC_MEM/USER/PATH1/O1234\" Z484", "\"O1234-O1234\" Z501"}) {
    stream->send(hex("a0a0a0a0 0001 1501 0204 00000001 " + name));
    EXPECT_EQ(show(stream->receive(10)), show(hex("a0a0a0a0 0003 1502 0000")));
    std::string text;
    Frame frame = nextFrame(*stream);
    for (; frame.is(FRAME_UPLOAD_DATA, DIR_STREAM); frame = nextFrame(*stream)) {
      EXPECT_LE(frame.body.size(), 0x500u);
      text.append(frame.body.begin(), frame.body.end());
    }
    EXPECT_TRUE(frame.is(FRAME_UPLOAD_END, DIR_REQUEST));
    EXPECT_EQ(text, "%\nO1234\n" + std::string(3000, 'X') + "\n%\n");
    stream->send(hex("a0a0a0a0 0001 1702 0000"));
  }
  stream->send(hex("a0a0a0a0 0001 1501 0204 00000001 \"O0009\" Z507"));
  EXPECT_EQ(show(stream->receive(18)), show(hex("a0a0a0a0 0003 1503 0008 0000 0005 0000 0000")));
}

TEST_F(ConformanceTest, TheThirtyFirstConnectionIsRefusedByTcpUntilOthersClose) {
  std::vector<std::unique_ptr<RawSocket>> sockets;
  for (int i = 0; i < 30; ++i) {
    sockets.push_back(std::make_unique<RawSocket>(RawSocket::connectTo(server_.port())));
  }
  const auto refused = [&] {
    try {
      RawSocket socket(RawSocket::connectTo(server_.port()));
      return false;
    } catch (const std::runtime_error&) {
      return true;
    }
  };
  EXPECT_TRUE(eventually(refused));
  sockets.clear();
  EXPECT_TRUE(eventually([&] { return !refused(); }));
  open(2);
}

TEST_F(ConformanceTest, TenThousandBytesOfMergedRequestsAreAnsweredInOrder) {
  const auto data = open(2);
  Bytes all;
  const int count = 10000 / 40 + 1;
  for (int i = 0; i < count; ++i) {
    const Bytes one = encodeFrame(FRAME_DATA, DIR_REQUEST,
                                  encodeRequests({SubRequest(OP_READ_MACRO, 500 + i % 3, 500 + i % 3)}), 1);
    all.insert(all.end(), one.begin(), one.end());
  }
  ASSERT_GE(all.size(), 10000u);
  data->send(all);
  for (int i = 0; i < count; ++i) {
    const Frame frame = nextFrame(*data);
    ASSERT_TRUE(frame.is(FRAME_DATA, DIR_REPLY)) << i;
    const double expected[] = {2.5, std::numeric_limits<double>::quiet_NaN(), -7.0};
    const std::vector<SubReply> replies = decodeReplies(frame.body);
    Reader reader(replies.at(0).data);
    const double value = reader.value8().toDouble();
    EXPECT_TRUE(value == expected[i % 3] || (i % 3 == 1 && std::isnan(value))) << i;
  }
}

TEST(Describe, UnprintableNamesAreReplaced) {
  const Frame frame{REPLY_VERSION, FRAME_DATA, DIR_REPLY,
                    hex("0001 0018 0001 0001 0089 000000000000 0008 580a1b5b ff000000")};
  EXPECT_EQ(describe(frame), "axis names = X??[ ?");
}

TEST(Describe, AFrameIsOneLine) {
  const auto line = [](const std::string& bytes) {
    const Bytes data = hex(bytes);
    FrameReader reader;
    reader.append(data.data(), data.size());
    return describe(*reader.next());
  };
  EXPECT_EQ(line("a0a0a0a0 0001 0101 0002 0001"), "open circuit 1");
  EXPECT_EQ(line("a0a0a0a0 0001 2101 001e 0001 001c 0001 0001 0015 000001f4 000001f4 Z12"),
            "rdmacro(500,500)");
  EXPECT_EQ(line("a0a0a0a0 0003 2102 001a 0001 0018 0001 0001 0015 000000000000 0008 0001e240 000a 0003"),
            "rdmacro = 123.456");
  EXPECT_EQ(line("a0a0a0a0 0003 2102 0012 0001 0010 0001 0001 0015 0003 0000 0000 0000"),
            "rdmacro = EW_NUMBER (3), detail 0");
  EXPECT_EQ(line("a0a0a0a0 0003 1903 0008 0000 000c 0000 0000"), "dnc start refused: EW_MODE (12), detail 0");
  EXPECT_EQ(line("a0a0a0a0 0001 1a04 0006 0a \"G0 X\" 0a"), "dnc 6 bytes \"|G0 X|\"");
  EXPECT_EQ(line("a0a0a0a0 0001 2101 0004 0001 ffff"),
            "data: FOCAS data end early: expected 65533 bytes, found 0");
}

}  // namespace
}  // namespace smartmill::focas
