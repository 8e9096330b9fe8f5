// First connection by the services of setup_node, the written file read by daq_node, and alignment_node.
#include <cmath>
#include <string>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <smartmill_msgs/CalibrateChannel.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/TryInstrument.h>

#include "smartmill_core/formatted.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/names.h"
#include "smartmill_core/testing/eventually.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_daq_testing/child.h"

namespace smartmill::daq {
namespace {

constexpr double RATE = 4000.0;  // [Hz]

std::string description(const std::string& sensitivity) {
  return "format: smartmill-instrument/1\nname: bench\ndriver: file\noptions: {path: device.csv, repeat: "
         "true}\n"
         "sample_rate: 4000.0\nstreams:\n  - topic: daq/vibration\n    channels:\n"
         "      - {input: 1, name: x, unit: m/s2, sensitivity: " +
         sensitivity + ", range: 5.0}\n";
}

TEST(SetupNode, WhatItWritesIsWhatDaqNodeReads) {
  using smartmill_msgs::CalibrateChannel;
  using smartmill_msgs::TryInstrument;
  ros::NodeHandle nh;
  const TemporaryFolder folder;
  std::string text = "one [V]\n";
  // 5 m/s2 RMS at 0.02 V/(m/s2), 160 Hz: two seconds are a number of periods.
  for (int i = 0; i < static_cast<int>(2.0 * RATE); ++i)
    text += formatted("%.9f\n", 0.1 * std::sqrt(2.0) * std::sin(units::TWO_PI * 160.0 * i / RATE));
  folder.write("device.csv", text);
  const testing::Child setup({SETUP_NODE, "__ns:=/smartmill", "__name:=setup", "_folder:=" + folder.file("")},
                             {}, folder.file("log"));
  ASSERT_TRUE(eventually([] { return ros::service::exists("/smartmill/daq/calibrate_channel", false); },
                         ros::spinOnce))
      << readText(folder.file("log"));

  TryInstrument attempt;
  const auto call = [&] {
    return ros::service::call(std::string("/smartmill/") + names::TRY_INSTRUMENT, attempt);
  };
  ASSERT_TRUE(call());
  EXPECT_EQ(attempt.response.code, TryInstrument::Response::OK);
  EXPECT_NE(joined(attempt.response.drivers).find("file, tcp"), std::string::npos);
  EXPECT_NE(joined(attempt.response.option_key).find("host"), std::string::npos);

  attempt.request.description = description("0");
  attempt.request.seconds = 1.0;
  ASSERT_TRUE(call());
  EXPECT_EQ(attempt.response.code, TryInstrument::Response::BAD_DESCRIPTION);
  EXPECT_EQ(attempt.response.message,
            "instrument: streams[0].channels[0].sensitivity: 0, expected volts per m/s2");

  attempt.request.description = description("0.025");
  ASSERT_TRUE(call());
  EXPECT_EQ(attempt.response.code, TryInstrument::Response::OK) << attempt.response.message;
  ASSERT_EQ(attempt.response.channel.size(), 1u);
  EXPECT_EQ(attempt.response.samples, 4000u);
  EXPECT_NEAR(attempt.response.rms[0], 4.0, 1e-3);  // 5 m/s2 with a sensitivity that is 25 % too large

  attempt.request.seconds = 0.0;
  attempt.request.file = "bench";
  ASSERT_TRUE(call());
  EXPECT_EQ(attempt.response.code, TryInstrument::Response::OK) << attempt.response.message;
  const std::string path = attempt.response.path;
  ASSERT_TRUE(call());
  EXPECT_EQ(attempt.response.code, TryInstrument::Response::NOT_WRITTEN);

  CalibrateChannel calibration;
  auto& request = calibration.request;
  request.file = "bench";
  request.topic = "daq/vibration";
  request.channel = "x";
  request.method = request.EXCITER;
  request.seconds = 1.5;
  request.exciter = 5.0;
  request.frequency = 159.155;
  const auto calibrate = [&] {
    return ros::service::call(std::string("/smartmill/") + names::CALIBRATE_CHANNEL, calibration);
  };
  ASSERT_TRUE(calibrate());
  EXPECT_EQ(calibration.response.code, CalibrateChannel::Response::OK) << calibration.response.message;
  EXPECT_NEAR(calibration.response.sensitivity, 0.02, 0.02 * 1e-3);
  request.method = request.STORE;
  request.date = "2026-11-28";
  ASSERT_TRUE(calibrate());
  EXPECT_EQ(calibration.response.code, CalibrateChannel::Response::OK) << calibration.response.message;

  // daq_node reads the file, and states level and date in its diagnostics.
  std::string channel;
  const auto sub = nh.subscribe<diagnostic_msgs::DiagnosticArray>(
      "/diagnostics", 100, [&](const diagnostic_msgs::DiagnosticArray::ConstPtr& m) {
        for (const auto& status : m->status) {
          if (status.name.find("channel daq/vibration/x") == std::string::npos) continue;
          channel = status.message;
          for (const auto& value : status.values) channel += "|" + value.key + "=" + value.value;
        }
      });
  const testing::Child node({DAQ_NODE, "__ns:=/smartmill", "__name:=daq", "_instrument:=" + path}, {},
                            folder.file("daq_log"));
  const auto value = [&](const std::string& key) {
    const std::size_t at = channel.find("|" + key + "=");
    return at == std::string::npos ? std::string() : channel.substr(at + key.size() + 2, 8);
  };
  EXPECT_TRUE(eventually(
      [&] {
        return channel.rfind("alive", 0) == 0 && !value("rms [m/s2]").empty() &&
               std::abs(std::stod(value("rms [m/s2]")) - 5.0) < 0.01;
      },
      ros::spinOnce))
      << channel;
  EXPECT_EQ(value("date of the sensitivity"), "2026-11-");
}

TEST(AlignmentNode, ShiftAndStandardDeviationAreInTheDiagnostics) {
  ros::NodeHandle nh;
  std::string aligned;
  double shift = 0.0, deviation = 0.0;
  const auto sub = nh.subscribe<diagnostic_msgs::DiagnosticArray>(
      "/diagnostics", 100, [&](const diagnostic_msgs::DiagnosticArray::ConstPtr& m) {
        for (const auto& status : m->status) {
          if (status.name.find("alignment daq/hammer/hammer to daq/dynamometer/fz") == std::string::npos)
            continue;
          aligned = status.message;
          for (const auto& value : status.values) {
            if (value.key == "shift [s]") shift = std::stod(value.value);
            if (value.key == "standard deviation of the shift [s]") deviation = std::stod(value.value);
          }
        }
      });
  auto hammer = nh.advertise<smartmill_msgs::SampleBlock>(names::HAMMER, 2000);
  auto force = nh.advertise<smartmill_msgs::SampleBlock>(names::DYNAMOMETER, 2000);
  ASSERT_TRUE(eventually([&] { return hammer.getNumSubscribers() > 0 && force.getNumSubscribers() > 0; },
                         ros::spinOnce));
  const auto block = [](int number, const char* channel, double delay) {
    smartmill_msgs::SampleBlock message;
    message.header.stamp = ros::Time(1000.0 + 0.01 * number + delay);
    message.sample_rate = RATE;
    message.first_index = static_cast<std::uint64_t>(40 * number);
    message.channels = {channel};
    message.units = {"N"};
    for (int i = 0; i < 40; ++i) {
      const double time = 0.01 * number + i / RATE;
      double value = 0.01 * std::sin(1234.0 * time);
      for (const double at : {0.7, 1.5, 3.1, 4.2})
        if (time > at && time < at + 2e-3) value += 100.0 * std::sin(units::PI * (time - at) / 2e-3);
      message.samples.push_back(value);
    }
    return message;
  };
  for (int b = 0; b < 520; ++b) {
    hammer.publish(block(b, "hammer", 0.0231));
    force.publish(block(b, "fz", 0.0));
  }
  EXPECT_TRUE(eventually([&] { return deviation > 0.0; }, ros::spinOnce)) << aligned;
  EXPECT_NEAR(shift, 0.0231, 3.0 * deviation);
  EXPECT_LT(deviation, 1e-3 / 4.0);
  EXPECT_NE(aligned.find("later than daq/dynamometer/fz, by taps (4)"), std::string::npos) << aligned;
}

}  // namespace
}  // namespace smartmill::daq

int main(int argc, char** argv) {
  ros::init(argc, argv, "setup_node_test");
  ros::NodeHandle keeps_alive;
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
