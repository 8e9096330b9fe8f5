// daq_node between a device of the test and a force compensation: the same forces as without it.
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <ros/ros.h>
#include <smartmill_msgs/ForceBlock.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>
#include <sys/socket.h>

#include "smartmill_core/formatted.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/names.h"
#include "smartmill_core/testing/eventually.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_daq/drivers/frame.h"
#include "smartmill_daq_testing/child.h"
#include "smartmill_ros/follower.h"

namespace smartmill::daq {
namespace {

constexpr double RATE = 25600.0;  // [Hz]
constexpr int BLOCK = 256, COUNT = 300;
constexpr int GAP_AT = 200, GAP = 100;  // [1] block before which samples are missing, samples

/// A device on the loopback interface.
class Device {
 public:
  Device() : listener_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {  // not inherited by daq_node
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    ::bind(listener_, reinterpret_cast<sockaddr*>(&address), sizeof address);
    ::listen(listener_, 1);
    ::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size);
    port = ntohs(address.sin_port);
  }
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;
  ~Device() { unplug(); }
  void accept() { socket_ = ::accept(listener_, nullptr, nullptr); }
  void send(const std::string& bytes) const {
    for (std::size_t at = 0; at < bytes.size();) {
      const ssize_t sent = ::send(socket_, bytes.data() + at, bytes.size() - at, MSG_NOSIGNAL);
      ASSERT_GT(sent, 0);
      at += static_cast<std::size_t>(sent);
    }
  }
  /// It does not listen either, as a device without power.
  void unplug() {
    for (int* const descriptor : {&listener_, &socket_}) {
      if (*descriptor >= 0) ::close(*descriptor);
      *descriptor = -1;
    }
  }
  int port = 0;

 private:
  int listener_, socket_ = -1;
};

std::string instrument(int port) {
  std::string text = formatted(
      "format: smartmill-instrument/1\nname: front end\ndriver: tcp\noptions: {host: 127.0.0.1, port: %d}\n"
      "sample_rate: 25600.0\nblock: 0.01\nclock: device\nsilence: 60.0\nstreams:\n  - topic: "
      "daq/dynamometer\n"
      "    frame: dynamometer\n    channels:\n",
      port);
  for (const char* const axis : {"x", "y", "z"})
    text += formatted("      - {input: %d, name: f%s, unit: N, sensitivity: 0.5, range: 1000.0}\n",
                      axis[0] - 'w', axis);
  return text;
}

/// Block of a cut at 930 Hz, the first mode of the sensor.
smartmill_msgs::SampleBlock blockOf(int b, double start) {
  smartmill_msgs::SampleBlock block;
  const std::uint64_t first = static_cast<std::uint64_t>(b) * BLOCK + (b >= GAP_AT ? GAP : 0);
  block.header.stamp = ros::Time(start + static_cast<double>(first) / RATE);
  block.header.frame_id = "dynamometer";
  block.sample_rate = RATE;
  block.first_index = first;
  block.channels = {"fx", "fy", "fz"};
  block.units = {"N", "N", "N"};
  for (int i = 0; i < BLOCK; ++i) {
    const double phase =
        units::TWO_PI * 930.0 * static_cast<double>(first + static_cast<std::uint64_t>(i)) / RATE;
    // Halves are exact, as are the quarters that the device sends.
    for (const double force : {100.0 * std::cos(phase), 40.0 * std::sin(phase), 5.0})
      block.samples.push_back(std::round(force * 1024.0) / 1024.0);
  }
  return block;
}

std::string frameOf(const smartmill_msgs::SampleBlock& block) {
  Frame frame;
  frame.format = SampleFormat::float64;
  frame.channels = 3;
  frame.first_index = block.first_index;
  frame.time = static_cast<std::int64_t>(block.header.stamp.toNSec());
  frame.sample_rate = block.sample_rate;
  for (const double force : block.samples) frame.values.push_back(0.5 * force);  // [V]
  return encode(frame);
}

using Forces = std::map<std::uint64_t, smartmill_msgs::ForceBlock>;  // by first index

TEST(DaqNode, theForceCompensationGivesTheSameAsWithoutIt) {
  ros::NodeHandle nh;
  Forces through, direct;
  std::vector<smartmill_msgs::SampleBlock> blocks;
  std::string instrument_state, channel_state;
  const auto collect = [&nh](const std::string& topic, Forces& forces) {
    return nh.subscribe<smartmill_msgs::ForceBlock>(
        topic, 2000,
        [&forces](const smartmill_msgs::ForceBlock::ConstPtr& m) { forces[m->first_index] = *m; });
  };
  const auto sub1 = collect(names::absolute(names::FORCE_COMPENSATED), through);
  const auto sub2 = collect("/direct/force/compensated", direct);
  const auto sub3 = nh.subscribe<smartmill_msgs::SampleBlock>(
      names::DYNAMOMETER, 2000,
      [&](const smartmill_msgs::SampleBlock::ConstPtr& message) { blocks.push_back(*message); });
  const auto sub4 = nh.subscribe<diagnostic_msgs::DiagnosticArray>(
      "/diagnostics", 100, [&](const diagnostic_msgs::DiagnosticArray::ConstPtr& m) {
        for (const auto& status : m->status) {
          if (status.name.find("instrument front end") != std::string::npos) {
            instrument_state = status.message;
            for (const auto& value : status.values) instrument_state += "|" + value.key + "=" + value.value;
          }
          if (status.name.find("channel daq/dynamometer/fx") != std::string::npos)
            channel_state = status.message;
        }
      });
  auto samples = nh.advertise<smartmill_msgs::SampleBlock>("/direct/daq/dynamometer", 2000);
  auto angle = nh.advertise<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE, 2000);
  auto direct_angle = nh.advertise<smartmill_msgs::SpindleAngle>("/direct/spindle/angle", 2000);

  const TemporaryFolder folder;
  Device device;
  const testing::Child node({DAQ_NODE, "__ns:=/smartmill", "__name:=daq",
                             "_instrument:=" + folder.write("instrument.yaml", instrument(device.port))},
                            {}, folder.file("log"));
  device.accept();
  ASSERT_TRUE(eventually([&] { return sub3.getNumPublishers() > 0; }, ros::spinOnce))
      << readText(folder.file("log"));
  Followers nodes({names::absolute("kalman"), "/direct/kalman"});
  nodes.begin();
  for (const ros::Publisher& publisher : {samples, angle, direct_angle}) nodes.expect(publisher);
  for (const ros::Subscriber& listener : {sub1, sub2, sub3}) nodes.expect(listener);
  const double start = std::floor(ros::Time::now().toSec());
  for (int b = 0; b < COUNT; ++b) {
    const smartmill_msgs::SampleBlock block = blockOf(b, start);
    smartmill_msgs::SpindleAngle turned;
    turned.header.stamp = block.header.stamp;
    turned.speed = units::TWO_PI * 232.5;
    nodes.publish(angle, turned);
    nodes.publish(direct_angle, turned);
    nodes.publish(samples, block);
    device.send(frameOf(block));
    nodes.sent(names::absolute(names::DYNAMOMETER));
    ros::spinOnce();
  }
  nodes.settle();
  nodes.end();
  ASSERT_TRUE(
      eventually([&] { return blocks.size() >= COUNT && direct.size() >= COUNT && through.size() >= COUNT; },
                 ros::spinOnce))
      << blocks.size() << " blocks, " << direct.size() << " and " << through.size() << " forces";
  for (int b = 0; b < COUNT; ++b) {
    const smartmill_msgs::SampleBlock sent = blockOf(b, start);
    const smartmill_msgs::SampleBlock& got = blocks[static_cast<std::size_t>(b)];
    ASSERT_EQ(got.first_index, sent.first_index);
    ASSERT_NEAR((got.header.stamp - sent.header.stamp).toSec(), 0.0, 0.3e-6);  // digits of a double
    ASSERT_EQ(got.samples, sent.samples);
    ASSERT_EQ(got.channels, sent.channels);
    ASSERT_EQ(got.header.frame_id, "dynamometer");
  }
  for (const auto& [index, force] : direct) {
    ASSERT_EQ(through.count(index), 1u);
    ASSERT_EQ(through[index].fx, force.fx) << index;
    ASSERT_EQ(through[index].fy, force.fy);
    ASSERT_EQ(through[index].status, force.status);
  }
  EXPECT_TRUE(eventually(
      [&] {
        return instrument_state.find("|samples lost=" + std::to_string(GAP) + "|") != std::string::npos &&
               instrument_state.find("|samples in blocks=" + std::to_string(COUNT * BLOCK) + "|") !=
                   std::string::npos;
      },
      ros::spinOnce))
      << instrument_state;
  device.unplug();
  EXPECT_TRUE(eventually(
      [&] {
        return instrument_state.find("Connection refused") != std::string::npos &&
               instrument_state.find("|unplugged events=1|") != std::string::npos &&
               channel_state.find("Connection refused") != std::string::npos;
      },
      ros::spinOnce))
      << instrument_state;
}

TEST(DaqNode, aWrongInstrumentIsRefusedInOneLine) {
  const TemporaryFolder folder;
  std::string text = instrument(5045);
  text.replace(text.find("unit: N"), 7, "unit: kN");
  const std::string file = folder.write("instrument.yaml", text);
  const std::string command = std::string(DAQ_NODE) + " __ns:=/smartmill __name:=wrong _instrument:=" + file +
                              " > " + folder.file("log") + " 2>&1";
  EXPECT_NE(std::system(command.c_str()), 0);
  const std::string log = readText(folder.file("log"));
  EXPECT_NE(log.find("daq: " + file + ": streams[0].channels[0].unit: 'kN' is not one of N | N m"),
            std::string::npos)
      << log;
}

}  // namespace
}  // namespace smartmill::daq

int main(int argc, char** argv) {
  ros::init(argc, argv, "daq_node_test");
  ros::NodeHandle keeps_alive;
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
