// A recorder that splits its file and is killed loses at most the chunk that it was writing.

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <ros/ros.h>
#include <smartmill_msgs/ModalModel.h>
#include <smartmill_msgs/SampleBlock.h>

#include "smartmill_core/names.h"
#include "smartmill_core/testing/eventually.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_recording/account.h"
#include "smartmill_recording/recording_reader.h"
#include "smartmill_recording/recording_writer.h"

namespace {

using namespace smartmill;

constexpr std::size_t SIZE = 1000;           // [samples] of a block
constexpr double RATE = 1e5;                 // [Hz]
constexpr std::uintmax_t SPLIT = 2'000'000;  // [byte]
constexpr std::uint64_t CHUNK = 768 * 1024;  // [byte] of the recording that is written at once

std::size_t messagesOf(const std::string& path, const std::string& topic, RecordingEnd end) {
  const auto file = openRecording(path, end);
  std::size_t count = 0;
  for (RecordingFile::Entry entry; file->next(&entry);)
    count += file->connection(entry).topic == topic ? 1 : 0;
  return count;
}

TEST(Recorder, PartsAndWhatIsLeftOfTheLastAreOneCompleteRecording) {
  const TemporaryFolder folder;
  ros::NodeHandle nh;
  const std::string samples = names::absolute(names::DYNAMOMETER), modes = names::absolute(names::TOOL_MODES);
  ros::Publisher blocks = nh.advertise<smartmill_msgs::SampleBlock>(samples, 0);
  ros::Publisher latched = nh.advertise<smartmill_msgs::ModalModel>(modes, 1, true);
  smartmill_msgs::ModalModel model;
  model.direction = "x";
  latched.publish(model);

  const std::string first = folder.file("week.bag");
  const pid_t recorder = ::fork();
  if (recorder == 0) {
    ::execlp(RECORD, "record", "-o", first.c_str(), "--split-mb", "2.0", samples.c_str(), modes.c_str(),
             nullptr);
    ::_exit(127);
  }
  ASSERT_TRUE(eventually([&] { return blocks.getNumSubscribers() == 1 && latched.getNumSubscribers() == 1; },
                         ros::spinOnce));

  // Noise, which LZ4 does not compress.
  smartmill_msgs::SampleBlock block;
  block.header.frame_id = "dynamometer";
  block.sample_rate = RATE;
  block.channels = {"fx"};
  block.units = {"N"};
  block.samples.resize(SIZE);
  std::uint64_t sent = 0;
  const auto send = [&](std::uint64_t count) {
    for (const std::uint64_t end = sent + count; sent < end; ++sent) {
      for (double& sample : block.samples) sample = ::drand48();
      block.header.stamp = ros::Time(1.7e9 + static_cast<double>(sent * SIZE) / RATE);
      block.first_index = sent * SIZE;
      blocks.publish(block);
      ros::WallDuration(1e-3).sleep();
    }
  };
  const std::string part_1 = folder.file("week_1.bag"), part_2 = folder.file("week_2.bag");
  const std::vector<std::string> files{first, part_1, part_2 + ".active"};
  send(500);  // 4 MB
  ASSERT_TRUE(eventually(
      [&] {
        send(20);
        return std::filesystem::exists(files[2]) && std::filesystem::file_size(files[2]) > CHUNK;
      },
      ros::spinOnce));
  ::kill(recorder, SIGKILL);
  ::waitpid(recorder, nullptr, 0);
  ASSERT_FALSE(std::filesystem::exists(part_2));

  // Each part can be replayed alone: it begins with the latched messages.
  std::size_t received = 0;
  for (const std::string& file : files) {
    const RecordingEnd end = file == files[2] ? RecordingEnd::any : RecordingEnd::index;
    EXPECT_LE(std::filesystem::file_size(file), SPLIT + 2 * CHUNK) << file;
    EXPECT_EQ(messagesOf(file, modes, end), 1u) << file;
    received += messagesOf(file, samples, end);
  }

  const std::string whole = folder.file("whole.bag");
  const ConvertedRecording joined = convertRecording(files, whole, RecordingCompression::lz4);
  EXPECT_EQ(joined.messages, received + 1);  // the latched message is there once
  const RecordingAccount account = accountOf({whole});
  EXPECT_TRUE(account.isComplete());
  EXPECT_LE(received, sent);
  EXPECT_LE((sent - received) * SIZE * sizeof(double), 2 * CHUNK);  // one, and what was on its way
  std::uint64_t next = 0;
  RecordingReader reader(whole);
  reader.on<SampleBlock>(names::DYNAMOMETER, [&](const SampleBlock& data, double) {
    EXPECT_EQ(data.first_index, next);
    next += data.size();
  });
  reader.run();
  EXPECT_EQ(next, received * SIZE);
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "recorder_test");
  ros::NodeHandle keep_ros_running;
  ::testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
