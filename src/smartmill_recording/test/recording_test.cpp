// Bags and MCAP files: against files and a reader written by the specification (test/*.py), against each
// other, and damaged.
#include "smartmill_recording/recording_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <sstream>
#include <tuple>

#include "checksum.h"
#include "message_definition.h"
#include "smartmill_core/error.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_recording/recording_writer.h"

namespace smartmill {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr std::uint64_t SECOND = 1000000000;  // [ns]

std::string contentOf(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

RecordingBytes bytesOf(const std::string& content) {
  RecordingBytes bytes;
  bytes.size = content.size();
  bytes.read = [&content](std::uint64_t at, char* to, std::size_t count) {
    ASSERT_LE(count, content.size());
    ASSERT_LE(at, content.size() - count);
    if (count > 0) std::memcpy(to, content.data() + at, count);
  };
  return bytes;
}

/// All that a recording holds: topic, type, MD5 sum, definition, further fields, time [ns], bytes.
using Held = std::tuple<std::string, std::string, std::string, std::string,
                        std::map<std::string, std::string>, std::uint64_t, std::string>;

std::vector<Held> messagesOf(RecordingFile& file) {
  std::vector<Held> held;
  RecordingFile::Entry entry;
  while (file.next(&entry)) {
    const RecordedConnection& c = file.connection(entry);
    const auto* const data = reinterpret_cast<const char*>(file.data(entry));
    held.emplace_back(c.topic, c.type, c.md5sum, c.definition, c.more, entry.time,
                      std::string(data, entry.size));
  }
  return held;
}

std::vector<Held> messagesOf(const std::string& path) {
  return messagesOf(*openRecording(path));
}

class Recordings : public ::testing::Test {
 protected:
  /// @return the standard output of a script in this folder
  std::string runScript(const std::string& script, const std::string& arguments) {
    const std::string out = folder_.file("script.txt");
    const int code =
        std::system(("/usr/bin/python3 test/" + script + " " + arguments + " > " + out + " 2>&1").c_str());
    EXPECT_EQ(code, 0) << contentOf(out);
    return contentOf(out);
  }

  std::string reference(const std::string& kind) {
    const std::string path = folder_.file(kind + ".mcap");
    runScript("write_mcap.py", kind + " " + path);
    return path;
  }

  /// Several chunks, two topics, neighbours swapped in time.
  std::string written(const std::string& name, RecordingCompression compression, int count = 3000) {
    const std::string path = folder_.file(name);
    const auto writer = createRecording(path, compression);
    SampleBlock block;
    block.sample_rate = 25600.0;
    block.channels = {"fx", "fy"};
    block.units = {"N", "N"};
    for (int i = 0; i < count; ++i) {
      const std::uint64_t time = 1763700000 * SECOND + static_cast<std::uint64_t>(i ^ 1) * 1234567;
      if (i % 3 == 0) {
        writer->write(names::SPINDLE_ANGLE, time, SpindleAngle{1.0 + i, 0.001 * i, 100.0});
      } else {
        block.stamp = 1.0 + i;
        block.samples.assign(256, 0.5 * i);
        block.samples[static_cast<std::size_t>(i) % 256] = 0.125;
        writer->write(names::DYNAMOMETER, time, block);
      }
    }
    writer->close();
    return path;
  }

  TemporaryFolder folder_;
};

TEST(Checksums, AreThoseOfTheirStandards) {
  const auto crc = [](const std::string& text) {
    return crc32(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
  };
  EXPECT_EQ(crc("123456789"), 0xCBF43926U);  // the check value of CRC-32/ISO-HDLC
  EXPECT_EQ(crc("The quick brown fox jumps over the lazy dog"), 0x414FA339U);
  const std::string text = "a longer text, in two pieces";
  EXPECT_EQ(crc32(reinterpret_cast<const std::uint8_t*>(text.data()) + 11, text.size() - 11,
                  crc(text.substr(0, 11))),
            crc(text));
  // RFC 1321, A.5.
  EXPECT_EQ(md5(""), "d41d8cd98f00b204e9800998ecf8427e");
  EXPECT_EQ(md5("message digest"), "f96b697d7cb7938d525a2f31aaf161d0");
  EXPECT_EQ(md5("12345678901234567890123456789012345678901234567890123456789012345678901234567890"),
            "57edf4a22be3c955ac49da2e2107b67a");
}

// Two implementations of the sum: the generator's at build time, the one for definitions in files.
TEST(Definitions, HaveTheSumOfTheirMessage) {
#define EXPECT_SUM(package, name) \
  EXPECT_EQ(definitionMd5(plain::name::TYPE, plain::name::DEFINITION), plain::name::MD5) << plain::name::TYPE;
  SMARTMILL_PLAIN_MESSAGES(EXPECT_SUM)
#undef EXPECT_SUM
  // Sums of messages of ROS that every installation has.
  EXPECT_STREQ(plain::Header::MD5, "2176decaecbce78abc3b96ef049fabed");
  EXPECT_STREQ(plain::WrenchStamped::MD5, "d78d3cb249ce23087ade7e7d0c40cfa7");
  EXPECT_STREQ(plain::TFMessage::MD5, "94810edda583a504dfda3829e70d7eec");
  EXPECT_EQ(definitionMd5("a/B", "string S = text # all of it\nint8 N=-1 # one\n"),
            md5("string S=text # all of it\nint8 N=-1"));
  EXPECT_EQ(definitionMd5("a/B", "C inside\n"), "");  // C is not there
  EXPECT_EQ(definitionMd5("a/B", "B inside\n"), "");
  // Nested deeper than any stack: no sum.
  std::string nested = "M1 inside\n";
  for (int i = 1; i < 200000; ++i) {
    const std::string number = std::to_string(i);
    nested += "====\nMSG: a/M" + number + "\nM" + std::to_string(i + 1) + " inside\n";
  }
  EXPECT_EQ(definitionMd5("a/M0", nested), "");
}

class Reference : public Recordings, public ::testing::WithParamInterface<const char*> {};

TEST_P(Reference, IsReadInTheOrderOfReception) {
  RecordingReader reader(reference(GetParam()));
  EXPECT_TRUE(reader.has(names::SPINDLE_ANGLE));
  EXPECT_TRUE(reader.has("/note"));
  EXPECT_FALSE(reader.has(names::HAMMER));
  int seen = 0;
  reader.on<SpindleAngle>(names::SPINDLE_ANGLE, [&](const SpindleAngle& angle, double time) {
    EXPECT_EQ(time, 10.0 + seen);
    EXPECT_EQ(angle.stamp, 10.0 + seen);
    EXPECT_EQ(angle.angle, seen);
    EXPECT_EQ(angle.speed, 100.0 + seen);
    ++seen;
  });
  reader.run();
  EXPECT_EQ(seen, 20);
  EXPECT_EQ(reader.duration(), 19.0);
}

TEST_P(Reference, CutOffAnywhereIsRefusedWithFileAndPosition) {
  const std::string content = contentOf(reference(GetParam()));
  for (std::size_t size = 0; size < content.size(); size += 7) {
    const std::string cut = content.substr(0, size);
    try {
      messagesOf(*openRecording(bytesOf(cut), "cut.mcap"));
      ADD_FAILURE() << size << " bytes of " << content.size() << " were read";
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), StartsWith("cut.mcap: "));
      if (size > 40) {
        EXPECT_THAT(error.what(), HasSubstr("at byte ")) << size;
      }
    }
  }
}

TEST_P(Reference, AFlippedBitGivesAnErrorOrTheSameMessages) {
  const std::string kind = GetParam();
  const std::string content = contentOf(reference(kind));
  const std::vector<Held> whole = messagesOf(*openRecording(bytesOf(content), "whole"));
  ASSERT_EQ(whole.size(), 20u);
  int refused = 0, same = 0;
  for (std::size_t at = 0; at < content.size(); ++at) {
    std::string flipped = content;
    flipped[at] = static_cast<char>(flipped[at] ^ (1 << at % 8));
    try {
      const std::vector<Held> held = messagesOf(*openRecording(bytesOf(flipped), "flipped.mcap"));
      // Without checksums a damaged sample goes unnoticed.
      if (kind != "bare") {
        EXPECT_EQ(held, whole) << at;
      }
      ++same;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), StartsWith("flipped.mcap: "));
      ++refused;
    }
  }
  EXPECT_GT(refused, kind == "bare" ? 100 : 500);
  // Outside chunks the checksums of data section and summary cover every byte.
  EXPECT_EQ(same > 0, kind != "loose");
}

INSTANTIATE_TEST_SUITE_P(Mcap, Reference, ::testing::Values("chunks", "loose", "bare"),
                         [](const auto& instance) { return std::string(instance.param); });

TEST_F(Recordings, OfAnotherTypeOrEncodingAreRefused) {
  const std::string path = reference("chunks");
  RecordingReader reader(path);
  reader.on<CncState>(names::SPINDLE_ANGLE, [](const CncState&, double) {});
  EXPECT_THAT([&] { reader.run(); },
              ::testing::ThrowsMessage<Error>(
                  path + ": topic /smartmill/spindle/angle holds smartmill_msgs/SpindleAngle, expected "
                         "smartmill_msgs/CncState"));
  EXPECT_THROW(openRecording(folder_.file("none.bag")), Error);
  EXPECT_THROW(openRecording(folder_.write("text.bag", "no bag at all")), Error);
  EXPECT_THROW(openRecording(folder_.write("empty.mcap", "")), Error);
  EXPECT_THROW(convertRecording({path}, folder_.file("a.bag"), RecordingCompression::none), Error);  // json
  EXPECT_FALSE(std::filesystem::exists(folder_.file("a.bag")));
  EXPECT_FALSE(std::filesystem::exists(folder_.file("a.bag.active")));
  EXPECT_THROW(createRecording(folder_.file("b.bag"), RecordingCompression::zstd), Error);
}

// An earlier version of a message lacks a constant; one that lacks a field is refused.
TEST_F(Recordings, AMessageOfOtherConstantsIsRead) {
  const std::string definition = plain::ForceBlock::DEFINITION, type = plain::ForceBlock::TYPE;
  const auto without = [&](const std::string& line) {
    const std::size_t begin = definition.find(line);
    return definition.substr(0, begin) + definition.substr(definition.find('\n', begin) + 1);
  };
  ForceBlock block;
  block.sample_rate = 1000.0;
  block.force = {{{1.0}, {2.0}, {3.0}}};
  const std::string bytes = writeMessage(toPlain(block));
  const auto read = [&](const std::string& text) {
    const std::string path = folder_.file("earlier.bag");
    const auto writer = createRecording(path, RecordingCompression::none);
    RecordedConnection connection;
    connection.topic = names::absolute(names::FORCE_COMPENSATED);
    connection.type = type;
    connection.definition = text;
    connection.md5sum = definitionMd5(type, text);
    EXPECT_NE(connection.md5sum, plain::ForceBlock::MD5);
    writer->write(writer->connect(connection), SECOND, reinterpret_cast<const std::uint8_t*>(bytes.data()),
                  bytes.size());
    writer->close();
    RecordingReader reader(path);
    double found = 0.0;
    reader.on<ForceBlock>(names::FORCE_COMPENSATED,
                          [&](const ForceBlock& b, double) { found = b.force[1].at(0); });
    reader.run();
    return found;
  };
  EXPECT_EQ(read(without("uint8 TRANSIENT=4")), 2.0);
  EXPECT_THROW(read(without("float64[] fz")), Error);
}

TEST_F(Recordings, TheFormatIsFoundByTheContent) {
  const std::string path = reference("chunks");
  const std::string renamed = folder_.file("renamed.bag");
  std::filesystem::rename(path, renamed);
  EXPECT_EQ(messagesOf(renamed).size(), 20u);
  EXPECT_TRUE(isRecording(renamed));
  EXPECT_TRUE(isRecording("none.mcap"));
  EXPECT_FALSE(isRecording(folder_.write("campaign.yaml", "a: 1\n")));
  EXPECT_FALSE(isRecording("test"));
}

TEST_F(Recordings, AnMcapFileIsWrittenAsTheSpecificationSays) {
  const std::string path = written("a.mcap", RecordingCompression::none);
  std::vector<Held> checked;
  std::istringstream lines(runScript("check_mcap.py", path));
  std::string topic;
  std::uint64_t time = 0;
  std::size_t size = 0;
  std::uint32_t checksum = 0;
  std::vector<std::tuple<std::uint64_t, std::string, std::size_t, std::uint32_t>> stated, seen;
  while (lines >> topic >> time >> size >> checksum) stated.emplace_back(time, topic, size, checksum);
  for (const Held& held : messagesOf(path)) {
    const std::string& data = std::get<6>(held);
    seen.emplace_back(std::get<5>(held), std::get<0>(held), data.size(),
                      crc32(reinterpret_cast<const std::uint8_t*>(data.data()), data.size()));
  }
  std::sort(stated.begin(), stated.end());
  EXPECT_EQ(seen.size(), 3000u);
  EXPECT_EQ(seen, stated);
}

TEST_F(Recordings, EveryCompressionHoldsTheSame) {
  const std::vector<Held> expected = messagesOf(written("none.mcap", RecordingCompression::none));
  ASSERT_EQ(expected.size(), 3000u);
  for (std::size_t i = 1; i < expected.size(); ++i)
    ASSERT_LE(std::get<5>(expected[i - 1]), std::get<5>(expected[i]));
  EXPECT_EQ(messagesOf(written("lz4.mcap", RecordingCompression::lz4)), expected);
  EXPECT_EQ(messagesOf(written("zstd.mcap", RecordingCompression::zstd)), expected);
  EXPECT_EQ(messagesOf(written("none.bag", RecordingCompression::none)), expected);
  EXPECT_EQ(messagesOf(written("lz4.bag", RecordingCompression::lz4)), expected);
  EXPECT_LT(std::filesystem::file_size(folder_.file("zstd.mcap")),
            std::filesystem::file_size(folder_.file("none.mcap")) / 4);
}

TEST_F(Recordings, ConversionLosesNothing) {
  const std::string bag = folder_.file("a.bag");
  {
    const auto writer = createRecording(bag, RecordingCompression::lz4);
    RecordedConnection connection;
    connection.topic = "/tf_static";
    connection.type = plain::TFMessage::TYPE;
    connection.md5sum = plain::TFMessage::MD5;
    connection.definition = plain::TFMessage::DEFINITION;
    connection.more = {{"callerid", "/a"}, {"latching", "1"}};
    const std::uint32_t first = writer->connect(connection);
    connection.more["callerid"] = "/b";  // another publisher of the same topic
    const std::uint32_t second = writer->connect(connection);
    connection = {};
    connection.topic = "/any";
    connection.type = "some_package/Any";
    connection.md5sum = "*";  // as topic_tools leave it
    const std::uint32_t third = writer->connect(connection);
    const std::uint8_t bytes[] = {0, 1, 2, 3, 255};
    for (std::uint64_t i = 0; i < 100; ++i) {
      writer->write(first, i / 2, bytes, i % 5);
      writer->write(second, i / 2, bytes, 5);
      writer->write(third, (i ^ 1) * SECOND, bytes, 0);
    }
    writer->close();
  }
  const std::vector<Held> expected = messagesOf(bag);
  ASSERT_EQ(expected.size(), 300u);
  const std::string mcap = folder_.file("a.mcap"), again = folder_.file("again.bag");
  double share = 0.0;
  EXPECT_EQ(
      convertRecording({bag}, mcap, RecordingCompression::zstd, [&](double done) { share = done; }).messages,
      300u);
  EXPECT_EQ(share, 1.0);
  EXPECT_EQ(messagesOf(mcap), expected);
  EXPECT_EQ(convertRecording({mcap}, again, RecordingCompression::none).messages, 300u);
  EXPECT_EQ(messagesOf(again), expected);
  EXPECT_THROW(convertRecording({bag}, bag, RecordingCompression::none), Error);
}

// A recorder that is killed leaves what it has written so far.
TEST_F(Recordings, WhatAKilledRecorderLeavesIsCopiedToItsLastCompleteRecord) {
  const std::string bytes(997, 'x');
  for (const char* ending : {".bag", ".mcap"}) {
    const std::string path = folder_.file("whole") + ending, active = path + ".active";
    const auto writer = createRecording(path, RecordingCompression::lz4);
    RecordedConnection connection;
    connection.topic = "/any";
    connection.type = "some_package/Any";
    const std::uint32_t number = writer->connect(connection);
    for (std::uint64_t i = 0; i < 3000; ++i)
      writer->write(number, 1000 * i, reinterpret_cast<const std::uint8_t*>(bytes.data()), i % 997);
    std::ifstream in(active, std::ios::binary);
    const std::string left((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    writer->close();
    const std::vector<Held> whole = messagesOf(path);
    EXPECT_THROW(openRecording(folder_.write("killed", left)), Error);
    std::size_t previous = 0;
    for (const std::size_t length : {left.size() / 5, left.size() / 2, left.size() - 1, left.size()}) {
      const std::string killed = folder_.write("killed", left.substr(0, length)),
                        copy = folder_.file("copy") + ending;
      const ConvertedRecording result = convertRecording({killed}, copy, RecordingCompression::none);
      const std::vector<Held> held = messagesOf(copy);
      EXPECT_EQ(held.size(), result.messages);
      EXPECT_LE(held.size(), whole.size());
      EXPECT_GE(held.size(), previous);
      previous = held.size();
      EXPECT_TRUE(std::equal(held.begin(), held.end(), whole.begin())) << ending << " " << length;
      EXPECT_EQ(result.left_out.at(0) == 0, length == left.size());
    }
    EXPECT_GT(previous, 500u) << ending;  // of 3000: a chunk is complete from 768 kB on
  }
}

TEST_F(Recordings, PartsBecomeOneRecording) {
  const std::uint8_t latched[] = {1, 2, 3}, other[] = {4, 5};
  std::vector<std::string> parts;
  for (std::uint64_t part = 0; part < 3; ++part) {
    parts.push_back(folder_.file("part" + std::to_string(part) + ".bag"));
    const auto writer = createRecording(parts.back(), RecordingCompression::lz4);
    RecordedConnection connection;
    connection.topic = "/state";
    connection.type = "some_package/Any";
    const std::uint32_t state = writer->connect(connection);
    connection.topic = "/modes";
    connection.more = {{"latching", "1"}};
    const std::uint32_t modes = writer->connect(connection);
    writer->write(modes, 1000 * part, latched, 3);  // repeated from the part before
    writer->write(state, 1000 * part + 1, other, 2);
    if (part == 1) writer->write(modes, 1000 * part + 2, latched, 3);  // published again
    writer->close();
  }
  const std::string whole = folder_.file("whole.bag");
  EXPECT_EQ(convertRecording(parts, whole, RecordingCompression::none).messages, 5u);
  std::vector<std::uint64_t> times;
  for (const Held& held : messagesOf(whole)) times.push_back(std::get<5>(held));
  EXPECT_EQ(times, (std::vector<std::uint64_t>{0, 1, 1001, 1002, 2001}));
}

// Each chunk has messages from all of the time: every one is decompressed once, not for each message.
TEST_F(Recordings, ChunksThatOverlapInTimeAreReadOnce) {
  constexpr std::uint64_t CHUNKS = 40, EACH = 500;
  const std::string path = folder_.file("overlapping.mcap");
  const std::string bytes(3000, 'x');  // 500 exceed the size at which the writer begins a new chunk
  {
    const auto writer = createRecording(path, RecordingCompression::zstd);
    RecordedConnection connection;
    connection.topic = "/any";
    connection.type = "some_package/Any";
    const std::uint32_t number = writer->connect(connection);
    for (std::uint64_t chunk = 0; chunk < CHUNKS; ++chunk)
      for (std::uint64_t i = 0; i < EACH; ++i)
        writer->write(number, (CHUNKS * i + chunk) * 1000,
                      reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
    writer->close();
  }
  const std::string content = contentOf(path);
  RecordingBytes counted = bytesOf(content);
  std::atomic<std::uint64_t> read{0};
  const auto inner = counted.read;
  counted.read = [&](std::uint64_t at, char* to, std::size_t count) {
    read += count;
    inner(at, to, count);
  };
  const auto file = openRecording(counted, "overlapping");
  RecordingFile::Entry entry;
  std::uint64_t messages = 0;
  while (file->next(&entry)) {
    ASSERT_EQ(entry.time, messages++ * 1000);
    ASSERT_EQ(file->data(entry)[0], 'x');
  }
  EXPECT_EQ(messages, CHUNKS * EACH);
  EXPECT_LT(read, 3 * content.size());
}

TEST_F(Recordings, WithoutMessagesAreRead) {
  for (const char* name : {"empty.bag", "empty.mcap"}) {
    const std::string path = folder_.file(name);
    createRecording(path, RecordingCompression::none)->close();
    RecordingReader reader(path);
    reader.run();
    EXPECT_EQ(reader.duration(), 0.0);
  }
}

TEST_F(Recordings, DamagedAnywhereGiveAnErrorOrTheSameMessages) {
  for (const auto& [name, compression] :
       std::vector<std::pair<std::string, RecordingCompression>>{{"none.mcap", RecordingCompression::none},
                                                                 {"lz4.mcap", RecordingCompression::lz4},
                                                                 {"zstd.mcap", RecordingCompression::zstd}}) {
    const std::string content = contentOf(written(name, compression, 120));
    const std::vector<Held> whole = messagesOf(*openRecording(bytesOf(content), "whole"));
    int refused = 0;
    for (std::size_t at = 0; at < content.size(); at += 97) {
      for (const bool cut : {true, false}) {
        std::string damaged = content;
        damaged[at] = static_cast<char>(damaged[at] ^ 0x55);
        if (cut) damaged = content.substr(0, at);
        try {
          EXPECT_EQ(messagesOf(*openRecording(bytesOf(damaged), "damaged")), whole) << name << " " << at;
        } catch (const Error& error) {
          EXPECT_THAT(error.what(), StartsWith("damaged: "));
          ++refused;
        }
      }
    }
    EXPECT_GT(refused, 50) << name;
  }
}

// A chunk that states more bytes than the file can fill.
TEST_F(Recordings, AClaimedSizeTakesNoMemory) {
  std::string content = contentOf(written("a.mcap", RecordingCompression::zstd, 10));
  // The first chunk: after magic, header record, and its own head the times (16), then the size.
  const std::size_t chunk = 8 + 9 + 4 + 4 + 4 + 9;
  ASSERT_EQ(content[chunk], '\x06');
  const std::uint64_t claimed = 0xFFFFFFF0U;
  std::memcpy(&content[chunk + 9 + 16], &claimed, sizeof claimed);
  EXPECT_THAT([&] { messagesOf(*openRecording(bytesOf(content), "claims")); },
              ::testing::ThrowsMessage<Error>(HasSubstr("shorter than stated")));
}

TEST_F(Recordings, AMessageShorterThanItsListsIsRefused) {
  const std::string path = folder_.file("short.mcap");
  {
    const auto writer = createRecording(path, RecordingCompression::none);
    RecordedConnection connection;
    connection.topic = names::absolute(names::DYNAMOMETER);
    connection.type = plain::SampleBlock::TYPE;
    connection.md5sum = plain::SampleBlock::MD5;
    connection.definition = plain::SampleBlock::DEFINITION;
    SampleBlock block;
    block.sample_rate = 1.0;
    block.channels = block.units = {"a"};
    block.samples = {1.0, 2.0};
    const std::string bytes = writeMessage(toPlain(block));
    writer->write(writer->connect(connection), 1, reinterpret_cast<const std::uint8_t*>(bytes.data()),
                  bytes.size() - 1);
    writer->close();
  }
  RecordingReader reader(path);
  reader.on<SampleBlock>(names::DYNAMOMETER, [](const SampleBlock&, double) {});
  EXPECT_THAT([&] { reader.run(); }, ::testing::ThrowsMessage<Error>(HasSubstr(
                                         path + ": topic /smartmill/daq/dynamometer: the message ends too "
                                                "early or is damaged: 2 x 8 bytes expected, 15 left")));
}

}  // namespace
}  // namespace smartmill
