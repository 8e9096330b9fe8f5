// Bags with damaged bytes: each is read, or refused with one line that names the file; a false length
// allocates no memory.
#include "smartmill_recording/recording_reader.h"

#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <smartmill_msgs/CncState.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <iterator>
#include <random>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/names.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_recording/recording_writer.h"
#include "smartmill_ros/conversions.h"

namespace smartmill {
namespace {

class DamagedBag : public ::testing::Test {
 protected:
  DamagedBag() {
    rosbag::Bag bag(file_, rosbag::bagmode::Write);
    smartmill_msgs::SampleBlock block;
    block.sample_rate = 100.0;
    block.channels = {"fx", "fy"};
    block.units = {"N", "N"};
    block.samples = {1.0, 2.0, 3.0, 4.0};
    bag.write(names::absolute(names::DYNAMOMETER), ros::Time(1.0), block);
    bag.write(names::absolute(names::CNC_STATE), ros::Time(2.0), smartmill_msgs::CncState());
    bag.close();
    std::ifstream in(file_, std::ios::binary);
    bytes_.assign(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  }
  /// Error of a reader of these bytes; empty: none.
  std::string fault(const std::vector<char>& bytes) const {
    std::ofstream(file_, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    try {
      RecordingReader reader(file_);
      reader.on<SampleBlock>(names::DYNAMOMETER, [](const auto&, double) {});
      reader.on<CncState>(names::CNC_STATE, [](const auto&, double) {});
      reader.on<SpindleAngle>(names::SPINDLE_ANGLE, [](const auto&, double) {});
      reader.run();
    } catch (const Error& e) {
      return e.what();
    }
    return {};
  }

  const TemporaryFolder folder_;
  const std::string file_ = folder_.file("damaged.bag");
  std::vector<char> bytes_;
};

TEST_F(DamagedBag, ALengthBeyondTheFileIsRefusedWithoutAllocation) {
  EXPECT_EQ(fault(bytes_), "");
  std::vector<char> bytes = bytes_;
  for (std::size_t i = 13; i < 17; ++i) {
    bytes[i] = '\x7f';
  }
  EXPECT_EQ(fault(bytes), file_ + ": is damaged: a record at byte 13 of " + std::to_string(bytes.size()) +
                              " states 2139062143 bytes");
}

TEST_F(DamagedBag, CompressedBagsAreRead) {
  for (const rosbag::compression::CompressionType compression :
       {rosbag::compression::BZ2, rosbag::compression::LZ4}) {
    {
      rosbag::Bag bag(file_, rosbag::bagmode::Write);
      bag.setCompression(compression);
      bag.setChunkThreshold(2000);  // several chunks
      smartmill_msgs::SpindleAngle angle;
      for (int i = 0; i < 500; ++i) {
        angle.angle = i;
        bag.write(names::absolute(names::SPINDLE_ANGLE), ros::Time(1.0 + (i ^ 1)), angle);
      }
      bag.close();
    }
    // In the order of reception, not of the file.
    RecordingReader reader(file_);
    std::vector<double> angles;
    reader.on<SpindleAngle>(names::SPINDLE_ANGLE, [&](const auto& m, double time) {
      EXPECT_EQ(time, 2.0 + static_cast<double>(angles.size()) - 1.0);
      angles.push_back(m.angle);
    });
    reader.run();
    ASSERT_EQ(angles.size(), 500u);
    for (int i = 0; i < 500; ++i) {
      ASSERT_EQ(angles[static_cast<std::size_t>(i)], i ^ 1);
    }
  }
}

/// The reader of ROS reads bags of this project.
TEST(WrittenBag, IsReadByRosbag) {
  const TemporaryFolder folder;
  for (const RecordingCompression compression : {RecordingCompression::none, RecordingCompression::lz4}) {
    const std::string file = folder.file("written.bag");
    constexpr int COUNT = 5000;  // several chunks
    {
      const auto writer = createRecording(file, compression);
      SampleBlock block;
      block.sample_rate = 100.0;
      block.channels = block.units = {"N"};
      for (int i = 0; i < COUNT; ++i) {
        const auto time = static_cast<std::uint64_t>(1000 + i) * 1000000001U;
        block.samples.assign(100, i);
        writer->write(names::DYNAMOMETER, time, block);
        writer->write(names::SPINDLE_ANGLE, time, SpindleAngle{1.0, 0.5 * i, 2.0});
      }
      writer->close();
    }
    const rosbag::Bag bag(file, rosbag::bagmode::Read);
    rosbag::View view(bag);
    EXPECT_EQ(view.size(), 2U * COUNT);
    EXPECT_EQ(view.getConnections().size(), 2U);
    EXPECT_EQ(view.getEndTime().toNSec(), (999U + COUNT) * 1000000001ULL);
    int blocks = 0, angles = 0;
    for (const rosbag::MessageInstance& message : view) {
      if (const auto block = message.instantiate<smartmill_msgs::SampleBlock>()) {
        ASSERT_EQ(message.getTopic(), names::absolute(names::DYNAMOMETER));
        ASSERT_EQ(message.getTime().toNSec(), static_cast<std::uint64_t>(1000 + blocks) * 1000000001U);
        ASSERT_EQ(block->samples, std::vector<double>(100, blocks++));
      } else if (const auto angle = message.instantiate<smartmill_msgs::SpindleAngle>()) {
        ASSERT_EQ(angle->angle, 0.5 * angles++);
      }
    }
    EXPECT_EQ(blocks, COUNT);
    EXPECT_EQ(angles, COUNT);
  }
}

TEST_F(DamagedBag, ACompressedChunkWithAWrongChecksumIsRefused) {
  {
    rosbag::Bag bag(file_, rosbag::bagmode::Write);
    bag.setCompression(rosbag::compression::LZ4);
    for (int i = 0; i < 100; ++i)
      bag.write(names::absolute(names::SPINDLE_ANGLE), ros::Time(1.0 + i), smartmill_msgs::SpindleAngle());
    bag.close();
  }
  std::ifstream in(file_, std::ios::binary);
  std::vector<char> bytes{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  ASSERT_EQ(fault(bytes), "");
  const std::string magic = "\x04\x22\x4d\x18";  // of a frame, preceded by its length
  const auto frame = std::search(bytes.begin(), bytes.end(), magic.begin(), magic.end());
  ASSERT_NE(frame, bytes.end());
  std::uint32_t length = 0;
  std::memcpy(&length, &*frame - sizeof length, sizeof length);
  *(frame + length - 1) ^= 1;  // last byte of the checksum
  EXPECT_NE(fault(bytes).find("checksum mismatch"), std::string::npos) << fault(bytes);
}

// The start times of the index are checked against the messages.
TEST_F(DamagedBag, AnIndexWithLaterTimesIsRefused) {
  const std::string key = "start_time=";
  std::vector<char> bytes = bytes_;
  const auto at = std::search(bytes.begin(), bytes.end(), key.begin(), key.end());
  ASSERT_NE(at, bytes.end());
  at[static_cast<std::ptrdiff_t>(key.size())] = 2;
  EXPECT_EQ(fault(bytes),
            file_ + ": is damaged: a message is older than the first time that is stated of its chunk");
  at[static_cast<std::ptrdiff_t>(key.size())] = 0;
  EXPECT_EQ(fault(bytes), "");
}

TEST_F(DamagedBag, AVectorLongerThanItsMessageIsRefusedWithoutAllocation) {
  // The count of the samples is the last count in the message; four doubles follow.
  std::vector<char> bytes = bytes_;
  const std::vector<char> count{4, 0, 0, 0, 0, 0, 0, 0, 0, 0, '\xf0', '\x3f'};  // 4, then 1.0
  const auto at = std::search(bytes.begin(), bytes.end(), count.begin(), count.end());
  ASSERT_NE(at, bytes.end());
  at[3] = '\x7f';
  EXPECT_NE(fault(bytes).find("the message ends too early or is damaged"), std::string::npos) << fault(bytes);
}

TEST_F(DamagedBag, AnyDamagedByteIsReadOrRefusedWithTheNameOfTheFile) {
  std::mt19937 random(5);
  int refused = 0;
  for (int i = 0; i < 300; ++i) {
    std::vector<char> bytes = bytes_;
    for (unsigned k = 0; k < 1 + random() % 3; ++k) {
      bytes[random() % bytes.size()] = static_cast<char>(random());
    }
    if (i % 5 == 0) {
      bytes.resize(random() % bytes.size());
    }
    const std::string line = fault(bytes);
    refused += line.empty() ? 0 : 1;
    EXPECT_TRUE(line.empty() || line.find(file_) != std::string::npos) << line;
  }
  EXPECT_GT(refused, 50);
}

}  // namespace
}  // namespace smartmill
